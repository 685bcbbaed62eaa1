//! What the flat graph remembers of its instances: models, ports, signals, and parameters with their defaults.

use super::frames::{FrameId, Here};
use super::scope::{Meaning, Scope};
use super::value::Place;
use crate::bond::graph::*;

impl Scope<'_> {
    /// Fills [`BondGraph::tree`], when all else is known.
    pub fn remember_instances(&mut self) {
        for at in 0..self.frames.len() {
            let instance = self.instance(at);
            self.graph.tree.push(instance);
        }
    }

    fn instance(&mut self, at: usize) -> Instance {
        let frame = &self.frames[at];
        let ports = frame.ports.iter().filter_map(|port| {
            let port = &self.ports[port.0 as usize];
            let own = port.name.strip_prefix(frame.prefix.as_str()).unwrap_or(&port.name);
            Some((own.to_string(), port.bond?))
        });
        let mut instance = Instance {
            name: frame.prefix.trim_end_matches('.').to_string(),
            model: self.bodies[frame.body].name.clone(),
            parent: frame.outer.map(|here| here.frame.0),
            span: frame.span,
            ports: ports.collect(),
            inputs: vec![],
            outputs: vec![],
            parameters: vec![],
        };
        let mut parameters = vec![];
        for (name, meaning) in &frame.values {
            match meaning {
                Meaning::Parameter(id) => parameters.push((*id, name.to_string())),
                Meaning::Signal(id) => {
                    let signal = self.graph.signals.get(id.index()).map(|signal| signal.origin);
                    if signal == Some(SignalOrigin::Input) {
                        instance.inputs.push(*id);
                    }
                }
            }
        }
        for (name, here) in &self.outputs {
            if here.frame.0 as usize == at
                && let Some(key) = self.key_at(name, *here)
                && let Some(Meaning::Signal(id)) = frame.values.get(&*key)
            {
                instance.outputs.push(*id);
            }
        }
        instance.inputs.sort_unstable();
        parameters.sort_unstable_by_key(|(id, _)| *id);
        instance.parameters = parameters
            .into_iter()
            .map(|(id, name)| self.instance_parameter(at, id, name))
            .collect();
        instance
    }

    fn instance_parameter(
        &mut self,
        at: usize,
        id: ParameterId,
        name: String,
    ) -> InstanceParameter {
        let frame = &self.frames[at];
        let header = self.bodies[frame.body].header;
        let declared = header.and_then(|header| header.iter().find(|own| own.name.text == name));
        let public = declared.is_some() || frame.public.contains(name.as_str());
        let value = self.parameters.get(id.index()).copied().flatten();
        let given = value.is_some_and(|value| value.here.frame.0 as usize != at);
        let default = declared.and_then(|own| own.default.as_ref()).filter(|_| given);
        // Where it says nothing, what is wrong with it is said where it is used.
        let here = Here { frame: FrameId(at as u32), round: None };
        let default = default.and_then(|default| {
            let place = Place::constant("a parameter");
            self.at(here, |scope| scope.lower(default, place, &mut vec![]))
        });
        InstanceParameter { id, name, public, given, default }
    }
}

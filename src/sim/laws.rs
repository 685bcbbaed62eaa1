//! A set of laws as two programs: values alone, and values with all partial derivatives.

use super::system::Target;
use crate::circuit::DeviceId;
use crate::circuit::stamps::Junction;
use crate::expr::{Dag, NodeId, Program, Unary};
use crate::linear::Pack;

/// A law on its way into a group.
pub(crate) struct Placed {
    pub node: NodeId,
    pub target: Target,
    pub device: DeviceId,
}

impl Placed {
    /// Whether it is affine in the unknowns, which stand before time, for fixed modes, which stand behind it.
    fn is_modal(&self, dag: &Dag, time: usize) -> bool {
        matches!(self.target, Target::Equations(_))
            && dag.is_affine_while(self.node, time as u32, time as u32 + 1)
    }
}

/// A group on its way into a system.
#[derive(Default)]
pub(crate) struct Group {
    pub dag: Dag,
    pub laws: Vec<Placed>,
    pub junction: Option<Junction>,
    /// Whether all its laws are affine for fixed modes.
    pub modal: bool,
}

impl Group {
    /// Takes out the laws that are affine for fixed modes.
    pub fn part_modal(&mut self, time: usize) -> Group {
        let laws = std::mem::take(&mut self.laws);
        let (modal, curved): (Vec<_>, Vec<_>) =
            laws.into_iter().partition(|law| law.is_modal(&self.dag, time));
        self.laws = curved;
        let dag = if modal.is_empty() { Dag::default() } else { self.dag.clone() };
        Group { dag, laws: modal, junction: None, modal: true }
    }
}

/// Laws over common inputs.
#[derive(Clone, Debug, Default)]
pub(crate) struct LawSet {
    values: Program,
    full: Program,
    /// The partial derivatives of law `o` are `starts[o]..starts[o + 1]`.
    starts: Vec<u32>,
    /// What each is taken by.
    inputs: Vec<u32>,
}

/// Room for the two programs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Registers {
    values: Vec<f64>,
    full: Vec<f64>,
}

/// Room for the values of several sets that differ in their constants alone, one in each lane.
#[derive(Clone, Debug)]
pub(crate) struct Abreast {
    values: Program,
    registers: Vec<Pack>,
}

impl Abreast {
    /// All lanes as those of a set.
    pub fn new(laws: &LawSet) -> Abreast {
        Abreast { values: laws.values.clone(), registers: laws.values.registers() }
    }

    /// Puts a set into a lane; says whether it differs in constants alone.
    pub fn put(&mut self, laws: &LawSet, lane: usize) -> bool {
        laws.values.put_constants(&self.values, lane, &mut self.registers)
    }

    /// Values of all laws.
    pub fn values(&mut self, inputs: &[Pack], out: &mut [Pack]) {
        self.values.run(inputs, &mut self.registers);
        for (out, value) in out.iter_mut().zip(self.values.outputs(&self.registers)) {
            *out = value;
        }
    }
}

impl LawSet {
    /// Compiles values and derivatives by the inputs below `inputs`.
    pub fn new(dag: &mut Dag, laws: &[NodeId], inputs: u32) -> LawSet {
        LawSet::with_slopes(dag, laws, |dag, law| {
            let mut slopes = dag.partials(law);
            slopes.retain(|(input, _)| *input < inputs);
            slopes
        })
    }

    /// Compiles values and derivatives of laws over the voltage of a junction, which is `voltage` among the inputs: those by
    /// its two ends differ in sign.
    pub fn of_junction(
        dag: &mut Dag,
        laws: &[NodeId],
        voltage: u32,
        junction: &Junction,
    ) -> LawSet {
        let [anode, cathode] = junction.across;
        LawSet::with_slopes(dag, laws, |dag, law| {
            let slope = dag.derivative(law, voltage);
            let by_anode = anode.map(|unknown| (unknown.0, slope));
            let by_cathode = cathode.map(|unknown| (unknown.0, dag.unary(Unary::Negate, slope)));
            by_anode.into_iter().chain(by_cathode).collect()
        })
    }

    /// Compiles values, and the derivatives that `slopes` gives of each law, with what each is taken by.
    fn with_slopes(
        dag: &mut Dag,
        laws: &[NodeId],
        mut slopes: impl FnMut(&mut Dag, NodeId) -> Vec<(u32, NodeId)>,
    ) -> LawSet {
        let mut outputs = laws.to_vec();
        let mut set = LawSet { starts: vec![0], ..LawSet::default() };
        for law in laws {
            for (input, derivative) in slopes(dag, *law) {
                set.inputs.push(input);
                outputs.push(derivative);
            }
            set.starts.push(set.inputs.len() as u32);
        }
        set.values = Program::compile(dag, laws);
        set.full = Program::compile(dag, &outputs);
        set
    }

    /// Compiles values only.
    pub fn without_derivatives(dag: &Dag, laws: &[NodeId]) -> LawSet {
        LawSet {
            values: Program::compile(dag, laws),
            starts: vec![0; laws.len() + 1],
            ..LawSet::default()
        }
    }

    /// Room to run in.
    pub fn registers(&self) -> Registers {
        Registers { values: self.values.registers(), full: self.full.registers() }
    }

    /// Number of laws.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Number of partial derivatives.
    pub fn partials(&self) -> usize {
        self.inputs.len()
    }

    /// The partial derivatives of a law.
    pub fn row(&self, law: usize) -> std::ops::Range<usize> {
        self.starts[law] as usize..self.starts[law + 1] as usize
    }

    /// What a partial derivative is taken by.
    pub fn input(&self, partial: usize) -> usize {
        self.inputs[partial] as usize
    }

    /// Number of instructions, without and with derivatives.
    pub fn instructions(&self) -> (usize, usize) {
        (self.values.instructions(), self.full.instructions())
    }

    /// Values of all laws.
    pub fn values(&self, inputs: &[f64], registers: &mut Registers, out: &mut [f64]) {
        self.values.run(inputs, &mut registers.values);
        for (out, value) in out.iter_mut().zip(self.values.outputs(&registers.values)) {
            *out = value;
        }
    }

    /// Values of all laws, each put where `places` says.
    pub fn scatter(
        &self,
        inputs: &[f64],
        registers: &mut Registers,
        places: &[u32],
        out: &mut [f64],
    ) {
        self.values.run(inputs, &mut registers.values);
        for (place, value) in places.iter().zip(self.values.outputs(&registers.values)) {
            out[*place as usize] = value;
        }
    }

    /// Values and partial derivatives of all laws.
    pub fn full(
        &self,
        inputs: &[f64],
        registers: &mut Registers,
        out: &mut [f64],
        partials: &mut [f64],
    ) {
        self.full.run(inputs, &mut registers.full);
        let all = out.iter_mut().chain(partials);
        for (out, value) in all.zip(self.full.outputs(&registers.full)) {
            *out = value;
        }
    }
}

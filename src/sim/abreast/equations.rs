//! What a circuit's equations leave over, and its charges, at one point in each lane.

use crate::circuit::stamps::Junction;
use crate::linear::{Number, Pack, put_lane};
use crate::sim::laws::Abreast;
use crate::sim::network::Network;
use crate::sim::sparse::Rows;
use crate::sim::system::{LawGroup, System, Target};

/// Larger circuits have too little of what is done in lanes, and too much that would have to be held for it.
const LARGEST: usize = 256;

/// Equations of circuits that differ in values alone, one in each lane.
#[derive(Debug)]
pub(super) struct Equations {
    time_input: usize,
    mode_slots: usize,
    groups: Vec<Laws>,
    conductances: Rows<Pack>,
    pub charges: Rows<Pack>,
    pub rates: Rows<Pack>,
    /// Where they are asked: unknowns, times and modes; what of the residual comes from sources.
    inputs: Vec<Pack>,
    drives: Vec<Pack>,
    /// Charges, and what is left over but for their rates.
    pub q: Vec<Pack>,
    pub residual: Vec<Pack>,
}

/// A group of laws.
#[derive(Debug)]
struct Laws {
    /// The programs; nothing of laws that are affine for fixed modes, whose values each run has at hand.
    programs: Option<Abreast>,
    junction: Option<Junction>,
    values: Vec<Pack>,
    /// Which value goes into which equation, with what factor; which into which charge.
    equations: Places,
    factors: Vec<Pack>,
    charges: Places,
}

/// Values by number, and what each goes into.
type Places = Vec<(u32, u32)>;

/// Which value goes into which equation, the factors of that, and which value goes into which charge.
fn places(group: &LawGroup) -> (Places, Vec<f64>, Places) {
    let (mut equations, mut factors, mut charges) = (vec![], vec![], vec![]);
    for (k, target) in group.targets.iter().enumerate() {
        match target {
            Target::Equations(into) => into.iter().for_each(|(row, factor)| {
                equations.push((k as u32, *row));
                factors.push(*factor);
            }),
            Target::Charge(charge) => charges.push((k as u32, *charge)),
        }
    }
    (equations, factors, charges)
}

impl Laws {
    fn new(group: &LawGroup) -> Laws {
        let (equations, factors, charges) = places(group);
        Laws {
            programs: (!group.modal).then(|| Abreast::new(&group.laws)),
            junction: group.junction,
            values: vec![Pack::ZERO; group.targets.len()],
            equations,
            factors: factors.into_iter().map(Pack::splat).collect(),
            charges,
        }
    }

    fn put(&mut self, group: &LawGroup, lane: usize) -> bool {
        let (equations, factors, charges) = places(group);
        let across = |junction: &Option<Junction>| junction.map(|junction| junction.across);
        let alike = self.values.len() == group.targets.len()
            && across(&self.junction) == across(&group.junction)
            && (&self.equations, &self.charges) == (&equations, &charges)
            && match &mut self.programs {
                Some(programs) => !group.modal && programs.put(&group.laws, lane),
                None => group.modal,
            };
        if alike {
            put_lane(&mut self.factors, lane, &factors);
        }
        alike
    }
}

impl Equations {
    /// The same circuit in all lanes; nothing of one that gains nothing by it.
    pub fn new(system: &System) -> Option<Equations> {
        let (n, charges) = (system.equations(), system.charges());
        if system.is_linear() || n > LARGEST {
            return None;
        }
        Some(Equations {
            time_input: system.time_input,
            mode_slots: system.mode_slots,
            groups: system.groups.iter().map(Laws::new).collect(),
            conductances: system.conductances.abreast(),
            charges: system.charges.abreast(),
            rates: system.rates.abreast(),
            inputs: vec![Pack::ZERO; system.inputs()],
            drives: vec![Pack::ZERO; n],
            q: vec![Pack::ZERO; charges],
            residual: vec![Pack::ZERO; n],
        })
    }

    /// Puts a circuit into a lane; says whether it fits.
    pub fn put(&mut self, system: &System, lane: usize) -> bool {
        let inputs = (self.time_input, self.mode_slots, self.inputs.len());
        inputs == (system.time_input, system.mode_slots, system.inputs())
            && self.drives.len() == system.equations()
            && self.groups.len() == system.groups.len()
            && self.conductances.put(&system.conductances, lane)
            && self.charges.put(&system.charges, lane)
            && self.rates.put(&system.rates, lane)
            && self.groups.iter_mut().zip(&system.groups).all(|(own, group)| own.put(group, lane))
    }

    /// Puts the point that they are asked at into a lane, with −b there.
    pub fn ask(
        &mut self,
        lane: usize,
        network: &mut Network,
        (t, x): (f64, &[f64]),
        drives: &[f64],
    ) {
        let (unknowns, others) = self.inputs.split_at_mut(self.time_input);
        put_lane(unknowns, lane, x);
        others[0].0[lane] = t;
        put_lane(&mut others[1..], lane, &network.modes);
        put_lane(&mut self.drives, lane, drives);
        for (k, laws) in self.groups.iter_mut().enumerate() {
            if laws.programs.is_none() {
                put_lane(&mut laws.values, lane, network.modal_values(k, x, t));
            }
        }
    }

    /// Q = C·x + q and r = G·x + f − b in every lane, as [`Network`] has them.
    pub fn evaluate(&mut self) {
        let n = self.drives.len();
        let Equations { groups, inputs, q, residual, .. } = self;
        for laws in groups.iter_mut() {
            if let Some(junction) = &laws.junction {
                let [anode, cathode] =
                    junction.across.map(|end| end.map_or(Pack::ZERO, |k| inputs[k.0 as usize]));
                inputs[self.time_input - 1] = anode - cathode;
            }
            if let Some(programs) = &mut laws.programs {
                programs.values(inputs, &mut laws.values);
            }
        }
        let one = Pack::splat(1.0);
        q.fill(Pack::ZERO);
        self.charges.add_product(one, &inputs[..n], q);
        residual.copy_from_slice(&self.drives);
        self.conductances.add_product(one, &inputs[..n], residual);
        for laws in groups.iter() {
            for (value, charge) in &laws.charges {
                let q = &mut q[*charge as usize];
                *q = *q + laws.values[*value as usize];
            }
            for ((value, row), factor) in laws.equations.iter().zip(&laws.factors) {
                let r = &mut residual[*row as usize];
                *r = *r + *factor * laws.values[*value as usize];
            }
        }
    }
}

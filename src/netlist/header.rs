//! The header of an emitted netlist: what plain SPICE text cannot say, as `*bondspice key=value` comments.
//!
//! Other simulators skip these lines; our reader honours them, so that reading an emitted netlist back gives the run
//! of the bond graph that it came from. Keys, in the order in which they are written:
//!
//! | key | value | meaning |
//! |---|---|---|
//! | `dialect` | `xyce` | the simulator that it was written for, when that is not ngspice |
//! | `hmax` | `auto` | the step limit of `.tran` is for other simulators |
//! | `grid` | seconds | rows at 0, grid, 2·grid … to the end of `.tran`, both included |
//! | `option` | `reltol=1e-6` | an option of the run; wins over `.options` |
//! | `jump` | `V_x 0.1 0.3` | the steep segments of the PWL of V_x that start at these times are exact jumps |
//! | `jump` | `V_x rise fall` | the same of the edges of a PULSE |
//! | `jump` | `V_x steps` | every second segment of the PWL, from its second on, is one |
//! | `sample` | `S_x C_x V_x 0.01 0` | S_x is no switch but holds the voltage at its second node, as it is at 0, 0.01 …, at its first one; its capacitor and its clock mean nothing; it comes in round 0 of those that do so at one instant |
//! | `scale` | `hydraulic 1e6` | the domain's efforts stand divided by the factor, its flows multiplied |
//! | `domain` | `hydraulic 1e6 1e-5 v(a) i(V_b)` | domain, usual magnitudes of its effort and flow as they stand here, variables |
//! | `column` | `["pump pressure","bar","v(a)/100000"]` | an output column: header, unit, value, as JSON |
//!
//! Keys other than `dialect`, `hmax` and `grid` repeat. Unknown keys are skipped: a newer version may have written them.

use crate::expr::print::number;

/// A domain with more variables than fit into a value this long goes on in another line of its own.
const DOMAIN_WIDTH: usize = 60;

/// The header, typed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Header {
    /// Whether the step limit of `.tran` is lifted.
    pub hmax_auto: bool,
    /// Output interval in seconds.
    pub grid: Option<f64>,
    /// Options as (key, value), later ones win.
    pub options: Vec<(String, String)>,
    /// Which steep segments are exact jumps.
    pub jumps: Vec<Jumps>,
    /// Switches that stand for exact samples.
    pub samples: Vec<Sample>,
    /// Domains that are scaled, and by what; columns are not.
    pub scales: Vec<(String, f64)>,
    /// Domains with their variables.
    pub domains: Vec<DomainVariables>,
    /// Output columns in order; empty when nothing was observed.
    pub columns: Vec<Column>,
}

/// The exact jumps of one source.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Jumps {
    /// The source, `V_x`.
    pub device: String,
    /// For a PWL: the start of each segment that is a jump, in seconds.
    pub times: Vec<f64>,
    /// For a PULSE: whether its rise is a jump.
    pub rise: bool,
    /// For a PULSE: whether its fall is one.
    pub fall: bool,
    /// For a PWL: whether every second segment, from the second on, is one.
    pub steps: bool,
}

/// A switch, a capacitor and a clock that stand for a value held between instants.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sample {
    /// The switch, from the node that holds to the one that is sampled.
    pub switch: String,
    /// The capacitor at the node that holds.
    pub capacitor: String,
    /// The source that closes the switch for a moment.
    pub clock: String,
    /// The time between instants, the first of which is 0, in seconds.
    pub period: f64,
    /// In which round it takes its value where several do at one instant.
    pub round: u32,
}

/// Circuit variables of a domain.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DomainVariables {
    /// Its name, `hydraulic`.
    pub domain: String,
    /// A usual magnitude of its effort: of each node voltage.
    pub effort: f64,
    /// A usual magnitude of its flow: of each current.
    pub flow: f64,
    /// Nodes, as they are named in the netlist.
    pub nodes: Vec<String>,
    /// Devices whose current is a flow of the domain.
    pub devices: Vec<String>,
}

/// An output column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Column {
    /// Its header.
    pub name: String,
    /// Its unit; empty for SI or none.
    pub unit: String,
    /// Its value as an expression of the netlist, scaled to the unit.
    pub expr: String,
}

impl Header {
    /// The header as pairs of keys and values.
    pub fn pairs(&self) -> Vec<(String, String)> {
        let mut pairs = Vec::new();
        let mut push = |key: &str, value: String| pairs.push((key.to_string(), value));
        if self.hmax_auto {
            push("hmax", "auto".to_string());
        }
        if let Some(grid) = self.grid {
            push("grid", number(grid));
        }
        for (key, value) in &self.options {
            push("option", format!("{key}={value}"));
        }
        for jumps in &self.jumps {
            let mut words = vec![jumps.device.clone()];
            words.extend(jumps.times.iter().map(|time| number(*time)));
            words.extend(jumps.rise.then(|| "rise".to_string()));
            words.extend(jumps.fall.then(|| "fall".to_string()));
            words.extend(jumps.steps.then(|| "steps".to_string()));
            push("jump", words.join(" "));
        }
        for sample in &self.samples {
            let Sample { switch, capacitor, clock, period, round } = sample;
            push("sample", format!("{switch} {capacitor} {clock} {} {round}", number(*period)));
        }
        for (domain, factor) in &self.scales {
            push("scale", format!("{domain} {}", number(*factor)));
        }
        for domain in &self.domains {
            let begin =
                format!("{} {} {}", domain.domain, number(domain.effort), number(domain.flow));
            let nodes = domain.nodes.iter().map(|node| format!("v({node})"));
            let devices = domain.devices.iter().map(|device| format!("i({device})"));
            let mut line = begin.clone();
            for word in nodes.chain(devices) {
                if line.len() + 1 + word.len() > DOMAIN_WIDTH && line.len() > begin.len() {
                    push("domain", std::mem::replace(&mut line, begin.clone()));
                }
                line.push(' ');
                line.push_str(&word);
            }
            push("domain", line);
        }
        for column in &self.columns {
            push("column", serde_json::json!([column.name, column.unit, column.expr]).to_string());
        }
        pairs
    }

    /// The header of pairs of keys and values; what could not be understood comes back beside it.
    pub fn read(pairs: &[(String, String)]) -> (Header, Vec<String>) {
        let mut header = Header::default();
        let mut strange = Vec::new();
        for (key, value) in pairs {
            if header.read_pair(key, value).is_none() {
                strange.push(format!("{key}={value}"));
            }
        }
        (header, strange)
    }

    fn read_pair(&mut self, key: &str, value: &str) -> Option<()> {
        match key {
            "hmax" => self.hmax_auto = value.trim() == "auto",
            "grid" => self.grid = Some(value.trim().parse().ok()?),
            "option" => {
                let (key, value) = value.split_once('=')?;
                self.options.push((key.trim().to_lowercase(), value.trim().to_string()));
            }
            "jump" => {
                let mut words = value.split_whitespace();
                let mut jumps = Jumps { device: words.next()?.to_string(), ..Jumps::default() };
                for word in words {
                    match word {
                        "rise" => jumps.rise = true,
                        "fall" => jumps.fall = true,
                        "steps" => jumps.steps = true,
                        time => jumps.times.push(time.parse().ok()?),
                    }
                }
                self.jumps.push(jumps);
            }
            "sample" => {
                let mut words = value.split_whitespace();
                let mut next = || words.next().map(str::to_string);
                self.samples.push(Sample {
                    switch: next()?,
                    capacitor: next()?,
                    clock: next()?,
                    period: next()?
                        .parse()
                        .ok()
                        .filter(|period: &f64| *period > 0.0 && period.is_finite())?,
                    round: next()?.parse().ok()?,
                });
            }
            "scale" => {
                let (domain, factor) = value.trim().split_once(' ')?;
                self.scales.push((domain.to_string(), factor.trim().parse().ok()?));
            }
            "domain" => {
                let mut words = value.split_whitespace();
                let mut domain = DomainVariables {
                    domain: words.next()?.to_string(),
                    effort: words.next()?.parse().ok()?,
                    flow: words.next()?.parse().ok()?,
                    ..DomainVariables::default()
                };
                for word in words {
                    let name = word.get(2..)?.strip_suffix(')')?.to_string();
                    match word.get(..2)? {
                        "v(" => domain.nodes.push(name),
                        "i(" => domain.devices.push(name),
                        _ => return None,
                    }
                }
                match self.domains.iter_mut().find(|known| {
                    (&known.domain, known.effort, known.flow)
                        == (&domain.domain, domain.effort, domain.flow)
                }) {
                    Some(known) => {
                        known.nodes.extend(domain.nodes);
                        known.devices.extend(domain.devices);
                    }
                    None => self.domains.push(domain),
                }
            }
            "column" => {
                let (name, unit, expr) = serde_json::from_str(value).ok()?;
                self.columns.push(Column { name, unit, expr });
            }
            _ => {}
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_survives_being_written_and_read() {
        let header = Header {
            hmax_auto: true,
            grid: Some(1e-3),
            options: vec![("reltol".into(), "1e-6".into())],
            jumps: vec![
                Jumps { device: "V_x".into(), times: vec![0.1, 0.3], ..Jumps::default() },
                Jumps { device: "V_p".into(), rise: true, fall: true, ..Jumps::default() },
                Jumps { device: "V_n".into(), steps: true, ..Jumps::default() },
            ],
            samples: vec![Sample {
                switch: "S_y".into(),
                capacitor: "C_y".into(),
                clock: "V_y_clock".into(),
                period: 0.01,
                round: 1,
            }],
            scales: vec![("hydraulic".into(), 1e6)],
            domains: vec![DomainVariables {
                domain: "hydraulic".into(),
                effort: 1e6,
                flow: 1e-5,
                nodes: (0..20).map(|n| format!("chamber_{n}")).collect(),
                devices: vec!["V_b".into(), "E_c".into()],
            }],
            columns: vec![Column {
                name: "pump \"p\", mean".into(),
                unit: "bar".into(),
                expr: "v(a)/100000".into(),
            }],
        };
        assert_eq!(Header::read(&header.pairs()), (header, vec![]));
    }

    #[test]
    fn what_is_not_understood_is_said_and_unknown_keys_are_skipped() {
        let pair = |key: &str, value: &str| (key.to_string(), value.to_string());
        let (header, strange) = Header::read(&[
            pair("grid", "soon"),
            pair("colour", "blue"),
            pair("domain", "hydraulic 1 1 q(a)"),
            pair("domain", "hydraulic 1 1 é"),
        ]);
        assert_eq!(header, Header::default());
        assert_eq!(strange, ["grid=soon", "domain=hydraulic 1 1 q(a)", "domain=hydraulic 1 1 é"]);
    }
}

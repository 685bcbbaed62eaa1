//! Independent sources as templates, one for each shape.
//!
//! Arguments that are left out or 0 have the values that SPICE gives them: see `flatten::sources`.

use super::law::Statement;
use super::template::Template;
use super::{Card, Device, Expr, Waveform, Writer, evaluate};
use crate::expr::print::number;
use crate::netlist::Shape;

/// A train of more pulses than 2 to this power is cut off behind them.
const MOST_FOLDS: u32 = 40;

impl<'a> Writer<'a> {
    /// A source of voltage, or else of current.
    pub(super) fn source(
        &mut self,
        card: &'a Card,
        device: &'a Device,
        waveform: &'a Waveform,
        voltage: bool,
    ) {
        let (what, letter) = if voltage { ("voltage", "v") } else { ("current", "i") };
        let named = |shape: &str, about: &str| {
            Template::new(&format!("bg_{letter}{shape}"), &format!("{what} source{about}"))
        };
        let (mut template, arguments) = match waveform {
            // Refused by the table of lacks.
            Waveform::Points { .. } | Waveform::Pattern { .. } => return,
            Waveform::Constant(value) => {
                (named("", "").numbers(&["dc"]), vec![self.value(card, value)])
            }
            Waveform::Function { shape, arguments } => match shape {
                Shape::Am => return,
                Shape::Pwl => {
                    let points = arguments.len() / 2;
                    let template = named(&format!("_pwl{points}"), ", straight lines");
                    let arguments = arguments.iter().take(2 * points);
                    let arguments = arguments.map(|value| self.value(card, value)).collect();
                    (polyline(template, points), arguments)
                }
                Shape::Pulse => self.pulse(card, arguments, &named),
                Shape::Sin => {
                    let defaults = [0.0, 0.0, 1.0 / self.stop, 0.0, 0.0, 0.0];
                    let template = named("_sin", ", a sine")
                        .numbers(&["vo", "va", "freq", "td", "theta", "phase"]);
                    let angle = format!("phase*{}", number(1f64.to_radians()));
                    let swing = format!(
                        "vo+va*exp(-(theta*(time-td)))*sin({}*freq*(time-td)+{angle})",
                        number(2.0 * std::f64::consts::PI)
                    );
                    let before = format!("vo+va*sin({angle})");
                    let cases = cases(&[("time < td", &before)], &swing);
                    (with(template, cases), self.arguments(card, arguments, &defaults))
                }
                Shape::Exp => {
                    let from = self.number(arguments.get(2)).filter(|value| *value != 0.0);
                    let from = from.unwrap_or(self.step);
                    let step = self.step;
                    let defaults = [0.0, 0.0, step, step, from + step, step];
                    let template = named("_exp", ", exponentials")
                        .numbers(&["v1", "v2", "td1", "tau1", "td2", "tau2"]);
                    let up = "v1+(v2-v1)*(1-exp(-((time-td1)/tau1)))";
                    let down = format!("{up}+(v1-v2)*(1-exp(-((time-td2)/tau2)))");
                    let cases = cases(&[("time < td1", "v1"), ("time < td2", up)], &down);
                    (with(template, cases), self.arguments(card, arguments, &defaults))
                }
                Shape::Sffm => {
                    let once = 1.0 / self.stop;
                    let template = named("_sffm", ", a modulated sine")
                        .numbers(&["vo", "va", "fc", "mdi", "fs"]);
                    let turn = number(2.0 * std::f64::consts::PI);
                    let value = format!("vo+va*sin({turn}*fc*time+mdi*sin({turn}*fs*time))");
                    let template = template.set("x", &value);
                    let defaults = [0.0, 0.0, once, 0.0, once];
                    (template, self.arguments(card, arguments, &defaults))
                }
            },
        };
        let value = if template.values.is_empty() { "dc" } else { "x" };
        template = if voltage {
            template.voltage(value)
        } else {
            template.current(value, self.taken.contains(&device.name))
        };
        self.entry(card, device, template, vec![], arguments);
    }

    fn number(&self, expr: Option<&Expr>) -> Option<f64> {
        evaluate(expr?, &self.values)
    }

    /// Arguments in order, with what stands for those that are left out or 0.
    fn arguments(&mut self, card: &Card, given: &[Expr], defaults: &[f64]) -> Vec<String> {
        let argument = |(k, default): (usize, &f64)| match given.get(k) {
            Some(expr) if self.number(Some(expr)) != Some(0.0) => self.value(card, expr),
            _ => number(*default),
        };
        defaults.iter().enumerate().map(argument).collect()
    }

    /// Pulses. The time within a period is found by taking off periods, half as many each time.
    fn pulse(
        &mut self,
        card: &Card,
        given: &[Expr],
        named: &dyn Fn(&str, &str) -> Template,
    ) -> (Template, Vec<String>) {
        let defaults = [0.0, 0.0, 0.0, self.step, self.step, self.stop, 0.0];
        let mut arguments = self.arguments(card, given, &defaults);
        let period = self.number(given.get(6)).unwrap_or(0.0);
        let folds = if period > 0.0 {
            let periods = (self.stop / period).max(1.0);
            (periods.log2().floor() as u32 + 1).min(MOST_FOLDS)
        } else {
            0
        };
        let name = if folds == 0 { "_pulse".to_string() } else { format!("_pulses{folds}") };
        let mut template = named(&name, if folds == 0 { ", a pulse" } else { ", pulses" })
            .numbers(&["lo", "hi", "td", "tr", "tf", "pw"]);
        if folds == 0 {
            arguments.truncate(6);
        } else {
            template = template.numbers(&["per"]);
        }
        template = template.set("u0", "time-td");
        for k in 0..folds {
            let (before, after) = (format!("u{k}"), format!("u{}", k + 1));
            let taken = format!("{}*per", number(2f64.powi((folds - 1 - k) as i32)));
            let set = |value: String| vec![Statement::Set(after.clone(), value)];
            template.statements.push(Statement::Cases(
                format!("{before} >= {taken}"),
                set(format!("{before}-{taken}")),
                set(before.clone()),
            ));
            template.values.push(after);
        }
        let u = format!("u{folds}");
        let up = format!("lo+(hi-lo)*{u}/tr");
        let down = format!("hi+(lo-hi)*({u}-tr-pw)/tf");
        let cases = cases(
            &[
                ("time < td", "lo"),
                (&format!("{u} < tr"), &up),
                (&format!("{u} < tr+pw"), "hi"),
                (&format!("{u} < tr+pw+tf"), &down),
            ],
            "lo",
        );
        (with(template, cases), arguments)
    }
}

/// x by cases.
fn cases(conditions: &[(&str, &str)], otherwise: &str) -> Vec<Statement> {
    let set = |value: &str| vec![Statement::Set("x".to_string(), value.to_string())];
    conditions.iter().rev().fold(set(otherwise), |rest, (condition, value)| {
        vec![Statement::Cases(condition.to_string(), set(value), rest)]
    })
}

fn with(mut template: Template, statements: Vec<Statement>) -> Template {
    template.values.push("x".to_string());
    template.statements.extend(statements);
    template
}

/// Straight lines between points (t1, y1), (t2, y2) …, held before and after them.
fn polyline(mut template: Template, points: usize) -> Template {
    for k in 1..=points {
        template.numbers.push((format!("t{k}"), "1"));
        template.numbers.push((format!("y{k}"), "1"));
    }
    let mut lines = vec![("time < t1".to_string(), "y1".to_string())];
    for k in 1..points {
        let next = k + 1;
        lines.push((
            format!("time < t{next}"),
            format!("y{k}+(y{next}-y{k})*(time-t{k})/(t{next}-t{k})"),
        ));
    }
    let lines: Vec<(&str, &str)> = lines.iter().map(|(c, v)| (c.as_str(), v.as_str())).collect();
    with(template, cases(&lines, &format!("y{points}")))
}

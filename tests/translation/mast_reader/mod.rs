//! Reads MAST as our templates use it, for tests: templates, instances, and the equations that they come to. Nothing
//! here knows how they are written; what it does not know it refuses.

mod formula;
mod dual;

pub use dual::Dual;
use formula::{Formula, parse};
use std::collections::HashMap;

/// A statement of a values section.
enum Statement {
    Set(usize, Formula),
    If(Formula, String, Formula, Vec<Statement>, Vec<Statement>),
}

/// An equation.
enum Equation {
    /// A current from one pin to another.
    Flow(usize, usize, Formula),
    /// Of the variable in this place: both sides are equal.
    Equal(usize, Formula, Formula),
}

/// A template. Its quantities have places: time, pins, refs, numbers, variables, values.
#[derive(Default)]
struct Template {
    pins: Vec<String>,
    refs: Vec<String>,
    numbers: Vec<String>,
    variables: Vec<String>,
    places: HashMap<String, usize>,
    statements: Vec<Statement>,
    initial: Vec<(usize, Formula)>,
    equations: Vec<Equation>,
}

/// An instance.
pub struct Instance {
    pub template: String,
    pub name: String,
    /// Its nodes by name.
    pub nodes: Vec<String>,
    refs: Vec<String>,
    pub numbers: Vec<f64>,
    /// Places of its quantities among the unknowns; `None` is ground.
    pins: Vec<Option<usize>>,
    others: Vec<usize>,
    /// The unknowns that are its own.
    pub own: Vec<(String, usize)>,
}

/// What a file comes to.
pub struct System {
    templates: HashMap<String, Template>,
    pub instances: Vec<Instance>,
    /// Nodes, then variables as `i(bg_v.V_x)`.
    pub unknowns: Vec<String>,
    pub nodes: usize,
}

/// What d_by_dt is.
pub trait Rate {
    /// The rate of a value at a place of the system.
    fn rate(&mut self, site: usize, value: Dual) -> Dual;
}

/// The text without comments, its continued lines joined.
fn lines(text: &str) -> Vec<String> {
    let mut lines: Vec<String> = vec![];
    let mut open = false;
    for line in text.lines() {
        let line = line.split('#').next().unwrap().trim_end();
        assert!(line.is_ascii(), "{line}");
        let (line, goes_on) = match line.strip_suffix('\\') {
            Some(line) => (line, true),
            None => (line, false),
        };
        if open {
            let last = lines.last_mut().unwrap();
            last.push(' ');
            last.push_str(line.trim());
        } else {
            lines.push(line.trim().to_string());
        }
        open = goes_on;
    }
    assert!(!open);
    lines.retain(|line| !line.is_empty());
    lines
}

fn list(text: &str) -> Vec<String> {
    text.split(',').map(|word| word.trim().to_string()).collect()
}

impl Template {
    fn place(&self, name: &str) -> usize {
        *self.places.get(name).unwrap_or_else(|| panic!("`{name}` is not declared"))
    }

    fn declare(&mut self, name: &str) -> usize {
        let place = self.places.len();
        assert!(
            self.places.insert(name.to_string(), place).is_none(),
            "`{name}` is declared twice"
        );
        place
    }

    fn formula(&self, text: &str) -> Formula {
        parse(text, &mut |name| self.place(name))
    }

    fn read(lines: &mut std::iter::Peekable<std::vec::IntoIter<String>>) -> (String, Template) {
        let head = lines.next().unwrap();
        let head = head.strip_prefix("element template ").unwrap();
        let (head, arguments) = match head.split_once('=') {
            Some((head, arguments)) => (head, list(arguments)),
            None => (head, vec![]),
        };
        let mut words = head.split_whitespace().map(str::to_string);
        let name = words.next().unwrap();
        let connections: Vec<String> = words.collect();
        let mut template = Template::default();
        template.declare("time");
        for line in lines.by_ref().take_while(|line| line != "{") {
            let (kind, names) = line.split_once(' ').unwrap();
            match kind {
                "electrical" => template.pins = list(names),
                "ref" => template.refs = list(names.strip_prefix("i ").unwrap()),
                "number" => {
                    let names = list(names).into_iter();
                    template.numbers =
                        names.map(|name| name.split_once(" = ").unwrap().0.to_string()).collect();
                }
                other => panic!("{other}"),
            }
        }
        assert_eq!([template.pins.clone(), template.refs.clone()].concat(), connections, "{name}");
        assert_eq!(template.numbers, arguments, "{name}");
        for name in [template.pins.clone(), template.refs.clone(), arguments].concat() {
            template.declare(&name);
        }
        let mut sections = vec![];
        loop {
            let line = lines.next().unwrap();
            match line.split_once(' ') {
                None => break assert_eq!(line, "}"),
                Some(("var", names)) => {
                    template.variables = list(names.strip_prefix("i ").unwrap())
                }
                Some(("val", names)) => {
                    for name in template.variables.clone() {
                        template.declare(&name);
                    }
                    for name in list(names.strip_prefix("nu ").unwrap()) {
                        template.declare(&name);
                    }
                }
                Some((section, "{")) => {
                    let variables = template.variables.clone();
                    for name in variables {
                        if !template.places.contains_key(&name) {
                            template.declare(&name);
                        }
                    }
                    sections.push(section.to_string());
                    template.section(section, lines);
                }
                _ => panic!("{line}"),
            }
        }
        assert!(sections.contains(&"equations".to_string()));
        (name, template)
    }

    fn section(&mut self, kind: &str, lines: &mut std::iter::Peekable<std::vec::IntoIter<String>>) {
        match kind {
            "values" => {
                let (statements, end) = self.statements(lines);
                assert_eq!(end, "}");
                self.statements = statements;
            }
            "control_section" => {
                for line in lines.by_ref().take_while(|line| line != "}") {
                    let inner = line.strip_prefix("initial_condition(").unwrap();
                    let (state, value) = inner.strip_suffix(')').unwrap().split_once(',').unwrap();
                    let value = self.formula(value);
                    self.initial.push((self.place(state), value));
                }
            }
            "equations" => {
                for line in lines.by_ref().take_while(|line| line != "}") {
                    let equation = if let Some((flow, value)) = line.split_once(" += ") {
                        let pins = flow.strip_prefix("i(").unwrap().strip_suffix(')').unwrap();
                        let (from, to) = pins.split_once("->").unwrap();
                        let pin = |name| self.pins.iter().position(|pin| pin == name).unwrap();
                        Equation::Flow(pin(from), pin(to), self.formula(value))
                    } else {
                        let (of, sides) = line.split_once(':').unwrap();
                        let (left, right) = sides.split_once('=').unwrap();
                        let of = self.variables.iter().position(|name| name == of).unwrap();
                        Equation::Equal(of, self.formula(left), self.formula(right))
                    };
                    self.equations.push(equation);
                }
            }
            other => panic!("{other}"),
        }
    }

    /// Statements up to the line that ends them, and that line.
    fn statements(
        &mut self,
        lines: &mut std::iter::Peekable<std::vec::IntoIter<String>>,
    ) -> (Vec<Statement>, String) {
        let mut statements = vec![];
        loop {
            let line = lines.next().unwrap();
            if line.starts_with('}') {
                return (statements, line);
            }
            if let Some(condition) = line.strip_prefix("if (") {
                let (statement, end) = self.cases(condition, lines);
                assert_eq!(end, "}");
                statements.push(statement);
            } else {
                let (name, value) = line.split_once(" = ").unwrap();
                statements.push(Statement::Set(self.place(name), self.formula(value)));
            }
        }
    }

    /// From behind `if (` to the line that ends the last case.
    fn cases(
        &mut self,
        condition: &str,
        lines: &mut std::iter::Peekable<std::vec::IntoIter<String>>,
    ) -> (Statement, String) {
        let condition = condition.strip_suffix(") {").unwrap();
        let words: Vec<&str> = condition.split(' ').collect();
        let at = words.iter().position(|word| ["<", "<=", ">", ">="].contains(word)).unwrap();
        let (left, right) = (words[..at].join(""), words[at + 1..].join(""));
        let (left, sign, right) = (self.formula(&left), words[at], self.formula(&right));
        let (then, next) = self.statements(lines);
        let (otherwise, end) = match next.strip_prefix("} else if (") {
            Some(condition) => {
                let (statement, end) = self.cases(condition, lines);
                (vec![statement], end)
            }
            None => {
                assert_eq!(next, "} else {");
                self.statements(lines)
            }
        };
        (Statement::If(left, sign.to_string(), right, then, otherwise), end)
    }
}

/// Reads a file.
pub fn read(text: &str) -> System {
    let mut lines = lines(text).into_iter().peekable();
    let mut templates = HashMap::new();
    let mut numbers: HashMap<String, f64> = HashMap::new();
    let mut instances: Vec<Instance> = vec![];
    while let Some(line) = lines.peek() {
        if line.starts_with("element template ") {
            let (name, template) = Template::read(&mut lines);
            assert!(templates.insert(name.clone(), template).is_none(), "{name} twice");
            continue;
        }
        let line = lines.next().unwrap();
        let mut places: Vec<String> = vec![];
        let mut constant = |text: &str, numbers: &HashMap<String, f64>| {
            let formula = parse(text, &mut |name| {
                places.push(name.to_string());
                places.len() - 1
            });
            let values: Vec<Dual> = places
                .iter()
                .map(|name| numbers.get(name).unwrap_or_else(|| panic!("{name} in {line}")))
                .map(|value| Dual::from(*value))
                .collect();
            formula.value(&values, &mut |_, _| panic!("{line}")).value
        };
        if let Some(parameter) = line.strip_prefix("number ") {
            let (name, value) = parameter.split_once(" = ").unwrap();
            let value = constant(value, &numbers);
            assert!(numbers.insert(name.to_string(), value).is_none(), "{name} twice");
            continue;
        }
        let (head, arguments) = match line.split_once(" = ") {
            Some((head, arguments)) => (head, list(arguments)),
            None => (line.as_str(), vec![]),
        };
        let mut words = head.split_whitespace().map(str::to_string);
        let (template, name) = words
            .next()
            .unwrap()
            .split_once('.')
            .map(|(a, b)| (a.to_string(), b.to_string()))
            .unwrap();
        let kind: &Template = templates.get(&template).unwrap_or_else(|| panic!("{line}"));
        let connections: Vec<String> = words.collect();
        assert_eq!(connections.len(), kind.pins.len() + kind.refs.len(), "{line}");
        let (nodes, refs) = connections.split_at(kind.pins.len());
        let mut given = HashMap::new();
        for argument in &arguments {
            let (name, value) = argument.split_once('=').unwrap();
            assert!(given.insert(name.to_string(), constant(value, &numbers)).is_none(), "{line}");
        }
        let values = kind
            .numbers
            .iter()
            .map(|name| given.remove(name).unwrap_or_else(|| panic!("{name} is missing: {line}")));
        let values = values.collect();
        assert!(given.is_empty(), "{given:?}: {line}");
        instances.push(Instance {
            template,
            name,
            nodes: nodes.to_vec(),
            refs: refs.to_vec(),
            numbers: values,
            pins: vec![],
            others: vec![],
            own: vec![],
        });
    }
    let mut unknowns: Vec<String> = vec![];
    for instance in &mut instances {
        for node in &instance.nodes {
            let place = (node != "0").then(|| {
                assert!(!numbers.contains_key(node), "{node} is a number and a node");
                unknowns.iter().position(|known| known == node).unwrap_or_else(|| {
                    unknowns.push(node.clone());
                    unknowns.len() - 1
                })
            });
            instance.pins.push(place);
        }
    }
    let nodes = unknowns.len();
    for instance in &mut instances {
        for variable in &templates[&instance.template].variables {
            let name = format!("{variable}({}.{})", instance.template, instance.name);
            assert!(!unknowns.contains(&name), "{name} twice");
            instance.own.push((variable.clone(), unknowns.len()));
            unknowns.push(name);
        }
    }
    for instance in &mut instances {
        for name in &instance.refs {
            let place = unknowns.iter().position(|known| known == name);
            instance.others.push(place.unwrap_or_else(|| panic!("{name} is nowhere")));
        }
    }
    System { templates, instances, unknowns, nodes }
}

impl System {
    /// The unknowns that an instance touches.
    pub fn touched(&self, instance: &Instance) -> Vec<usize> {
        let mut touched: Vec<usize> = instance.pins.iter().flatten().copied().collect();
        touched.extend(&instance.others);
        touched.extend(instance.own.iter().map(|(_, place)| place));
        touched.sort();
        touched.dedup();
        touched
    }

    /// What an instance adds to the equations: (equation, value), where the equation of a node is the sum of the
    /// currents that leave it, that of a variable the difference of its sides. Sites of d_by_dt are numbered from
    /// `site` on; how many there are comes back.
    pub fn add(
        &self,
        instance: &Instance,
        x: &dyn Fn(usize) -> Dual,
        time: Dual,
        site: usize,
        rate: &mut dyn Rate,
        to: &mut dyn FnMut(usize, Dual),
    ) -> usize {
        let template = &self.templates[&instance.template];
        let mut values = vec![Dual::from(f64::NAN); template.places.len()];
        values[0] = time;
        let voltages = instance.pins.iter().map(|pin| pin.map_or(Dual::from(0.0), x));
        let refs = instance.others.iter().map(|place| x(*place));
        let numbers = instance.numbers.iter().map(|value| Dual::from(*value));
        let own = instance.own.iter().map(|(_, place)| x(*place));
        for (place, value) in voltages.chain(refs).chain(numbers).chain(own).enumerate() {
            values[place + 1] = value;
        }
        run(&template.statements, &mut values);
        let mut sites = 0;
        let mut derive = |value: Dual| {
            sites += 1;
            rate.rate(site + sites - 1, value)
        };
        for equation in &template.equations {
            match equation {
                Equation::Flow(from, to_pin, value) => {
                    let value = value.value(&values, &mut |_, value| derive(value));
                    if let Some(from) = instance.pins[*from] {
                        to(from, value);
                    }
                    if let Some(end) = instance.pins[*to_pin] {
                        to(end, Dual::from(0.0) - value);
                    }
                }
                Equation::Equal(of, left, right) => {
                    let left = left.value(&values, &mut |_, value| derive(value));
                    let right = right.value(&values, &mut |_, value| derive(value));
                    to(instance.own[*of].1, left - right);
                }
            }
        }
        sites
    }

    /// What an instance begins at: the place of each state within its template by name, and the value.
    pub fn initial(&self, instance: &Instance) -> Vec<(String, f64)> {
        let template = &self.templates[&instance.template];
        let first = 1 + template.pins.len() + template.refs.len();
        let mut values = vec![Dual::from(f64::NAN); template.places.len()];
        for (k, value) in instance.numbers.iter().enumerate() {
            values[first + k] = Dual::from(*value);
        }
        let name = |place: usize| {
            template.places.iter().find(|(_, known)| **known == place).unwrap().0.clone()
        };
        let value = |formula: &Formula| formula.value(&values, &mut |_, _| panic!()).value;
        template.initial.iter().map(|(state, formula)| (name(*state), value(formula))).collect()
    }
}

fn run(statements: &[Statement], values: &mut [Dual]) {
    let plain = |formula: &Formula, values: &[Dual]| {
        formula.value(values, &mut |_, _| panic!("d_by_dt in a values section"))
    };
    for statement in statements {
        match statement {
            Statement::Set(place, value) => values[*place] = plain(value, values),
            Statement::If(left, sign, right, then, otherwise) => {
                let (left, right) = (plain(left, values).value, plain(right, values).value);
                let holds = match sign.as_str() {
                    "<" => left < right,
                    "<=" => left <= right,
                    ">" => left > right,
                    ">=" => left >= right,
                    other => panic!("{other}"),
                };
                run(if holds { then } else { otherwise }, values);
            }
        }
    }
}

//! Formulas of MAST: numbers, names, `+ - * /`, brackets, v(pin), d_by_dt(x), functions of one argument.

use super::Dual;

/// A formula over numbered quantities.
pub enum Formula {
    Number(f64),
    Quantity(usize),
    Negative(Box<Formula>),
    Two(char, Box<Formula>, Box<Formula>),
    Rate(Box<Formula>),
    Call(String, Box<Formula>),
}

impl Formula {
    /// Its value; `rate` is d_by_dt.
    pub fn value(&self, values: &[Dual], rate: &mut dyn FnMut((), Dual) -> Dual) -> Dual {
        match self {
            Formula::Number(value) => Dual::from(*value),
            Formula::Quantity(place) => values[*place],
            Formula::Negative(a) => Dual::from(0.0) - a.value(values, rate),
            Formula::Two(sign, a, b) => {
                let (a, b) = (a.value(values, rate), b.value(values, rate));
                match sign {
                    '+' => a + b,
                    '-' => a - b,
                    '*' => a * b,
                    _ => a / b,
                }
            }
            Formula::Rate(a) => {
                let a = a.value(values, rate);
                rate((), a)
            }
            Formula::Call(name, a) => a.value(values, rate).call(name),
        }
    }
}

struct Reader<'a> {
    text: &'a str,
    place: &'a mut dyn FnMut(&str) -> usize,
}

/// Reads a formula; `place` gives the number of a quantity.
pub fn parse(text: &str, place: &mut dyn FnMut(&str) -> usize) -> Formula {
    let mut reader = Reader { text: text.trim(), place };
    let formula = reader.sum();
    assert!(reader.text.is_empty(), "`{}` is left of `{text}`", reader.text);
    formula
}

impl Reader<'_> {
    fn peek(&mut self) -> char {
        self.text = self.text.trim_start();
        self.text.chars().next().unwrap_or('\0')
    }

    fn skip(&mut self, letter: char) {
        assert_eq!(self.peek(), letter, "at `{}`", self.text);
        self.text = &self.text[1..];
    }

    fn sum(&mut self) -> Formula {
        let mut left = self.product();
        while let sign @ ('+' | '-') = self.peek() {
            self.skip(sign);
            let right = self.product();
            left = Formula::Two(sign, Box::new(left), Box::new(right));
        }
        left
    }

    fn product(&mut self) -> Formula {
        let mut left = self.signed();
        while let sign @ ('*' | '/') = self.peek() {
            self.skip(sign);
            let right = self.signed();
            left = Formula::Two(sign, Box::new(left), Box::new(right));
        }
        left
    }

    fn signed(&mut self) -> Formula {
        if self.peek() == '-' {
            self.skip('-');
            return Formula::Negative(Box::new(self.signed()));
        }
        self.operand()
    }

    fn operand(&mut self) -> Formula {
        let first = self.peek();
        if first == '(' {
            self.skip('(');
            let inner = self.sum();
            self.skip(')');
            return inner;
        }
        if first.is_ascii_digit() {
            let letters: Vec<char> = self.text.chars().collect();
            let mut end = 0;
            while end < letters.len()
                && (letters[end].is_ascii_digit()
                    || matches!(letters[end], '.' | 'e')
                    || (matches!(letters[end], '+' | '-') && letters[end - 1] == 'e'))
            {
                end += 1;
            }
            let (number, rest) = self.text.split_at(end);
            self.text = rest;
            return Formula::Number(number.parse().unwrap_or_else(|_| panic!("`{number}`")));
        }
        let end = self.text.find(|c: char| !c.is_ascii_alphanumeric() && c != '_');
        let (name, rest) = self.text.split_at(end.unwrap_or(self.text.len()));
        assert!(first.is_ascii_alphabetic(), "at `{}`", self.text);
        self.text = rest;
        if self.peek() != '(' {
            return Formula::Quantity((self.place)(name));
        }
        self.skip('(');
        let inner = self.sum();
        self.skip(')');
        match name {
            // A pin stands for its voltage.
            "v" => {
                assert!(matches!(inner, Formula::Quantity(_)));
                inner
            }
            "d_by_dt" => Formula::Rate(Box::new(inner)),
            name => Formula::Call(name.to_string(), Box::new(inner)),
        }
    }
}

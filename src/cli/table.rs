//! Tables for people: columns of one width, numbers to the right.

/// Rows of text under headers.
#[derive(Clone, Debug)]
pub struct Table {
    headers: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    pub fn new(headers: &[&str]) -> Table {
        Table { headers: headers.iter().map(ToString::to_string).collect(), rows: vec![] }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// Whether it has no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The table as text, each line ended; a column of numbers is set to the right.
    pub fn to_text(&self) -> String {
        let cell = |row: &Vec<String>, at: usize| row.get(at).cloned().unwrap_or_default();
        let columns = self.headers.len();
        let width: Vec<usize> = (0..columns)
            .map(|at| {
                let cells = self.rows.iter().map(|row| cell(row, at).chars().count());
                cells.chain([self.headers[at].chars().count()]).max().unwrap_or(0)
            })
            .collect();
        let right: Vec<bool> = (0..columns)
            .map(|at| {
                let number = |text: String| text == "-" || text.parse::<f64>().is_ok();
                !self.rows.is_empty() && self.rows.iter().all(|row| number(cell(row, at)))
            })
            .collect();
        let line = |row: &Vec<String>| {
            let mut text = String::new();
            for at in 0..columns {
                let content = cell(row, at);
                let space = " ".repeat(width[at] - content.chars().count());
                let (before, after) =
                    if right[at] { (space, String::new()) } else { (String::new(), space) };
                text += &format!("{before}{content}{after}  ");
            }
            text.trim_end().to_string() + "\n"
        };
        std::iter::once(&self.headers).chain(&self.rows).map(line).collect()
    }
}

/// A number for people, to six digits.
pub fn short(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        return "0".into();
    }
    if !(1e-4..1e7).contains(&size) {
        let text = format!("{value:.5e}");
        return match text.split_once('e') {
            Some((digits, power)) if digits.contains('.') => {
                format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.'))
            }
            _ => text,
        };
    }
    let decimals = (5 - size.log10().floor() as i32).max(0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_to_six_digits() {
        for (value, text) in [
            (0.0, "0"),
            (1.0, "1"),
            (-0.1, "-0.1"),
            (1234.5678, "1234.57"),
            (1.0 / 3.0, "0.333333"),
            (5e-9, "5e-9"),
            (-1.2345678e12, "-1.23457e12"),
            (999999.96, "1000000"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(short(value), text);
        }
    }

    #[test]
    fn columns_line_up() {
        let mut table = Table::new(&["name", "max"]);
        table.row(["Ω".into(), "10".into()]);
        table.row(["pump pressure".into(), "-".into()]);
        assert_eq!(table.to_text(), "name           max\nΩ               10\npump pressure    -\n");
    }
}

//! The header of a plot in a RAW file, in ASCII or UTF-16.

use crate::trace::formats::{Failed, bad};
use std::borrow::Cow;

/// More variables than this are not believed.
const MOST_VARIABLES: usize = 1 << 24;

/// A line of a header longer than this belongs to no RAW file.
const LONGEST_LINE: usize = 1 << 20;

/// What the header of a plot says.
#[derive(Default)]
pub(super) struct Header {
    plot: String,
    pub complex: bool,
    pub points: usize,
    pub names: Vec<String>,
    pub units: Vec<String>,
    /// Whether numbers are binary, else text.
    pub binary: bool,
    /// Whether text is UTF-16.
    pub wide: bool,
    /// Whether LTspice wrote it.
    pub ltspice: bool,
    pub double: bool,
    pub fastaccess: bool,
    pub stepped: bool,
}

impl Header {
    /// The step that the name of the plot ends in, as we write it: `Transient Analysis (step 3)`.
    pub fn step(&self) -> Option<f64> {
        let (_, end) = self.plot.rsplit_once(" (step ")?;
        end.strip_suffix(')')?.parse().ok()
    }

    /// The name of the plot without its step.
    pub fn plot_name(&self) -> &str {
        match self.step() {
            Some(_) => self.plot.rsplit_once(" (step ").map_or("", |(name, _)| name),
            None => &self.plot,
        }
    }
}

/// The next line of a text, and what follows it.
fn line(bytes: &[u8], wide: bool) -> Option<(Cow<'_, str>, &[u8])> {
    if !wide {
        let end = bytes.iter().take(LONGEST_LINE).position(|byte| *byte == b'\n')?;
        return Some((String::from_utf8_lossy(&bytes[..end]), &bytes[end + 1..]));
    }
    let end = bytes.chunks_exact(2).take(LONGEST_LINE).position(|unit| unit == [b'\n', 0])?;
    Some((Cow::Owned(utf16(&bytes[..2 * end])), &bytes[2 * end + 2..]))
}

/// A text of UTF-16, little-endian.
pub(super) fn utf16(bytes: &[u8]) -> String {
    let units = bytes.chunks_exact(2).map(|unit| u16::from_le_bytes([unit[0], unit[1]]));
    char::decode_utf16(units).map(|letter| letter.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}

fn missing(what: &str) -> Failed {
    bad("E0922", format!("the header of the RAW file lacks {what}"))
}

/// Reads a header; what follows it are numbers.
pub(super) fn read(bytes: &[u8]) -> Result<(Header, &[u8]), Failed> {
    let mut header = Header { wide: bytes.starts_with(b"T\0"), ..Header::default() };
    header.ltspice = header.wide;
    let mut variables = 0;
    let mut rest = bytes;
    let count = |text: &str, what: &str| {
        let number = text.trim().parse::<usize>();
        number.map_err(|_| bad("E0922", format!("`{}` is no number of {what}", text.trim())))
    };
    loop {
        let (line, after) = line(rest, header.wide).ok_or_else(|| missing("its data"))?;
        rest = after;
        let (key, value) = line.split_once(':').unwrap_or((&line, ""));
        match key.trim().to_lowercase().as_str() {
            "plotname" => header.plot = value.trim().to_string(),
            "flags" => {
                let value = value.to_lowercase();
                let has = |flag: &str| value.split_whitespace().any(|word| word == flag);
                header.complex = has("complex");
                header.double = has("double");
                header.fastaccess = has("fastaccess");
                header.stepped = has("stepped");
                header.ltspice |= has("forward") || has("fastaccess");
            }
            "offset" => header.ltspice = true,
            "no. variables" => variables = count(value, "variables")?,
            "no. points" => header.points = count(value, "points")?,
            "variables" if variables > MOST_VARIABLES => {
                return Err(bad("E0922", format!("{variables} variables are too many")));
            }
            "variables" => rest = read_variables(&mut header, variables, value, rest)?,
            "binary" | "values" if header.names.is_empty() => return Err(missing("variables")),
            "binary" => {
                header.binary = true;
                return Ok((header, rest));
            }
            "values" => return Ok((header, rest)),
            _ => {}
        }
    }
}

fn read_variables<'a>(
    header: &mut Header,
    variables: usize,
    beside: &str,
    mut rest: &'a [u8],
) -> Result<&'a [u8], Failed> {
    // Some writers put the first variable on the line of the key.
    let mut first = Some(beside.to_string()).filter(|text| !text.trim().is_empty());
    for _ in 0..variables {
        let text = match first.take() {
            Some(text) => text,
            None => {
                let (text, after) = line(rest, header.wide).ok_or_else(|| missing("a variable"))?;
                rest = after;
                text.into_owned()
            }
        };
        let mut words = text.split_whitespace().skip(1);
        header.names.push(words.next().ok_or_else(|| missing("a variable"))?.into());
        header.units.push(unit(words.next().unwrap_or("")).into());
    }
    Ok(rest)
}

fn unit(kind: &str) -> &'static str {
    match kind {
        "time" => "s",
        "frequency" => "Hz",
        "voltage" => "V",
        "current" | "device_current" => "A",
        _ => "",
    }
}

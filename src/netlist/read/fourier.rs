//! `.four frequency item …`: which harmonics are to be told.

use super::{Cursor, Reader};
use crate::netlist::{CardKind, Fourier};

/// The card, whose keyword has been read.
pub fn fourier(reader: &mut Reader, cursor: &mut Cursor) -> Option<CardKind> {
    let frequency = reader.value(cursor, "the frequency of `.four frequency v(out) …`")?;
    let items = super::cards::items(reader, cursor)?;
    if items.is_empty() {
        reader.missing(cursor, "the first item of `.four frequency v(out) …`");
        return None;
    }
    Some(CardKind::Fourier(Fourier { frequency, items }))
}

//! Plain arrays out of NumPy's `.npz` archives, with bounded memory.
//!
//! An npz is a zip of `.npy` members, stored or deflated (PKWARE APPNOTE 4.3; NumPy NEP 1). What a
//! header claims is checked against what the archive holds before anything is inflated, and no
//! array may be larger than [`MAX_ARRAY`]. Arrays of Python objects would have to be unpickled,
//! which runs code of the file's author, so they are refused.

use crate::problem::Problem;
use flate2::read::DeflateDecoder;
use std::collections::BTreeMap;
use std::io::Read;

/// Numbers of an array, first axis slowest.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Lengths of its axes.
    pub shape: Vec<usize>,
    /// Its numbers; whole ones too.
    pub values: Vec<f64>,
}

/// An archive whose members are known and not yet inflated.
#[derive(Clone, Debug)]
pub struct Archive<'a> {
    members: BTreeMap<String, Member<'a>>,
}

#[derive(Clone, Copy, Debug)]
struct Member<'a> {
    packed: &'a [u8],
    deflated: bool,
    size: u64,
}

/// An array larger than this when inflated is refused \[bytes\]: the largest published body models
/// have 130 MB in one.
pub const MAX_ARRAY: u64 = 256 << 20;
/// Headers are a few hundred bytes.
const MAX_HEADER: usize = 1 << 16;

impl<'a> Archive<'a> {
    /// The members of the archive in `bytes`.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, Problem> {
        let damaged = || {
            Problem::whole(
                "the archive is damaged or cut off (its list of members cannot be followed); save \
                 or fetch it again",
            )
        };
        let members = directory(bytes).ok_or_else(damaged)?;
        Ok(Self { members })
    }

    /// Whether there is an array called `name`.
    pub fn has(&self, name: &str) -> bool {
        self.members.contains_key(&format!("{name}.npy"))
    }

    /// The numbers of the array called `name`.
    pub fn numbers(&self, name: &str) -> Result<Array, Problem> {
        let (header, data) = self.open(name)?;
        let bad = |text: String| Problem::at(format!("array `{name}`"), text);
        let width = header.kind.width();
        let read = |chunk: &[u8]| header.kind.number(chunk);
        let mut values: Vec<f64> = data.chunks_exact(width).map(read).collect();
        if let Some(at) = values.iter().position(|v| !v.is_finite()) {
            return Err(bad(format!(
                "entry {at} is not a finite number; the file cannot be used"
            )));
        }
        if header.fortran {
            values = row_by_row(&values, &header.shape);
        }
        Ok(Array {
            shape: header.shape,
            values,
        })
    }

    /// The words of the array of texts called `name`.
    pub fn texts(&self, name: &str) -> Result<Vec<String>, Problem> {
        let (header, data) = self.open(name)?;
        let Kind::Text { width, big } = header.kind else {
            let text = "holds numbers where names are expected";
            return Err(Problem::at(format!("array `{name}`"), text));
        };
        let letter = |b: &[u8]| {
            let b = [b[0], b[1], b[2], b[3]];
            let code = if big {
                u32::from_be_bytes(b)
            } else {
                u32::from_le_bytes(b)
            };
            char::from_u32(code).filter(|c| *c != '\0')
        };
        let word = |b: &[u8]| b.chunks_exact(4).filter_map(letter).collect();
        Ok(data.chunks_exact(width.max(1)).map(word).collect())
    }

    /// Header and inflated content of a member, of just the size that the header needs.
    fn open(&self, name: &str) -> Result<(Header, Vec<u8>), Problem> {
        let bad = |text: String| Problem::at(format!("array `{name}`"), text);
        let member = self
            .members
            .get(&format!("{name}.npy"))
            .ok_or_else(|| bad("is missing".to_owned()))?;
        let broken = || bad("is damaged: it cannot be inflated; fetch the file again".to_owned());
        let mut start = Vec::new();
        member
            .reader()
            .take(MAX_HEADER as u64)
            .read_to_end(&mut start)
            .map_err(|_| broken())?;
        let header = Header::parse(&start).map_err(bad)?;
        let size = header.data_size().filter(|size| *size <= MAX_ARRAY);
        let Some(size) = size else {
            return Err(bad(format!(
                "claims to have the shape {:?}, which is more than the {} MiB that are read; is it \
                 a body model?",
                header.shape,
                MAX_ARRAY >> 20
            )));
        };
        let total = header.start as u64 + size;
        if member.size != total {
            return Err(bad(format!(
                "claims the shape {:?}, {total} bytes, but the archive says that it holds {}; the \
                 file is damaged",
                header.shape, member.size
            )));
        }
        let mut data = Vec::new();
        member
            .reader()
            .take(total)
            .read_to_end(&mut data)
            .map_err(|_| broken())?;
        if data.len() as u64 != total {
            return Err(broken());
        }
        data.drain(..header.start);
        Ok((header, data))
    }
}

impl<'a> Member<'a> {
    fn reader(&self) -> Box<dyn Read + 'a> {
        if self.deflated {
            Box::new(DeflateDecoder::new(self.packed))
        } else {
            Box::new(self.packed)
        }
    }
}

/// What a number is in a file.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Real {
        width: usize,
        big: bool,
    },
    Whole {
        width: usize,
        signed: bool,
        big: bool,
    },
    Text {
        width: usize,
        big: bool,
    },
}

impl Kind {
    fn width(self) -> usize {
        match self {
            Self::Real { width, .. } | Self::Whole { width, .. } | Self::Text { width, .. } => {
                width
            }
        }
    }

    fn number(self, bytes: &[u8]) -> f64 {
        let mut b = [0; 8];
        let (width, big) = match self {
            Self::Real { width, big } | Self::Whole { width, big, .. } => (width, big),
            Self::Text { .. } => return f64::NAN,
        };
        b[..width].copy_from_slice(bytes);
        if big {
            b[..width].reverse();
        }
        let whole = u64::from_le_bytes(b);
        match self {
            Self::Real { width: 4, .. } => f64::from(f32::from_bits(whole as u32)),
            Self::Real { .. } => f64::from_bits(whole),
            Self::Whole { signed: true, .. } => {
                let unused = 64 - 8 * width as u32;
                ((whole << unused).cast_signed() >> unused) as f64
            }
            _ => whole as f64,
        }
    }

    /// Of a NumPy type as `<f4`.
    fn of(descr: &str) -> Result<Self, String> {
        if descr.contains('O') {
            return Err(
                "holds Python objects, which would have to be unpickled, and unpickling runs the \
                 file's code: convert it once with tools/convert_smpl.py in your own Python"
                    .to_owned(),
            );
        }
        let strange = || format!("has numbers of the type `{descr}`, which is not read");
        let mut letters = descr.chars();
        let (order, kind) = (letters.next(), letters.next());
        let width: usize = letters.as_str().parse().map_err(|_| strange())?;
        let big = order == Some('>');
        match (kind, width) {
            (Some('f'), 4 | 8) => Ok(Self::Real { width, big }),
            (Some('i'), 1 | 2 | 4 | 8) => Ok(Self::Whole {
                width,
                signed: true,
                big,
            }),
            (Some('u'), 1 | 2 | 4 | 8) => Ok(Self::Whole {
                width,
                signed: false,
                big,
            }),
            (Some('U'), 1..=1024) => Ok(Self::Text {
                width: 4 * width,
                big,
            }),
            _ => Err(strange()),
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
struct Header {
    kind: Kind,
    fortran: bool,
    shape: Vec<usize>,
    /// Where the numbers begin.
    start: usize,
}

impl Header {
    fn parse(bytes: &[u8]) -> Result<Self, String> {
        let no_header = || "has no NumPy header".to_owned();
        let version = *bytes
            .strip_prefix(b"\x93NUMPY")
            .and_then(|rest| rest.first())
            .ok_or_else(no_header)?;
        let (length, from) = if version == 1 {
            (u32::from(u16_at(bytes, 8).ok_or_else(no_header)?), 10)
        } else {
            (u32_at(bytes, 8).ok_or_else(no_header)?, 12)
        };
        let start = from + length as usize;
        let text = bytes.get(from..start).ok_or_else(no_header)?;
        let text = std::str::from_utf8(text).map_err(|_| no_header())?;
        let after = |key: &str| text.split_once(key).map(|(_, rest)| rest.trim_start());
        let descr = after("'descr':").ok_or_else(no_header)?;
        let descr = descr.strip_prefix('\'').and_then(|d| d.split('\'').next());
        let kind = Kind::of(descr.ok_or("is a table of several columns, not plain numbers")?)?;
        let fortran = after("'fortran_order':").is_some_and(|rest| rest.starts_with("True"));
        let shape = after("'shape':")
            .and_then(|rest| rest.strip_prefix('(')?.split(')').next())
            .ok_or_else(no_header)?;
        let lengths = shape.split(',').map(str::trim).filter(|n| !n.is_empty());
        let shape = lengths.map(str::parse).collect::<Result<Vec<usize>, _>>();
        Ok(Self {
            kind,
            fortran,
            shape: shape.map_err(|_| no_header())?,
            start,
        })
    }

    /// Bytes of the numbers; none when no memory could hold them.
    fn data_size(&self) -> Option<u64> {
        let multiply = |product: u64, length: &usize| product.checked_mul(*length as u64);
        // Lengths of zero must not hide a product that is too large.
        let nonzero = self.shape.iter().filter(|n| **n > 0);
        nonzero
            .clone()
            .try_fold(self.kind.width() as u64, multiply)?;
        self.shape
            .iter()
            .try_fold(self.kind.width() as u64, multiply)
    }
}

/// Values stored with the first axis fastest, reordered to have it slowest.
fn row_by_row(values: &[f64], shape: &[usize]) -> Vec<f64> {
    let mut strides = Vec::new();
    let mut stride = 1;
    for length in shape {
        strides.push(stride);
        stride *= length;
    }
    let mut index = vec![0; shape.len()];
    let mut ordered = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        let at: usize = index.iter().zip(&strides).map(|(i, s)| i * s).sum();
        ordered.push(values[at]);
        for axis in (0..shape.len()).rev() {
            index[axis] += 1;
            if index[axis] < shape[axis] {
                break;
            }
            index[axis] = 0;
        }
    }
    ordered
}

/// The members that a zip's central directory lists; none when it cannot be followed.
fn directory(bytes: &[u8]) -> Option<BTreeMap<String, Member<'_>>> {
    // The end record is the last thing in the file but for a comment of at most 65,535 bytes.
    let tail = bytes.len().saturating_sub(22 + 65_535);
    let end = (tail..bytes.len().checked_sub(21)?)
        .rev()
        .find(|at| bytes[*at..].starts_with(b"PK\x05\x06"))?;
    let count = u16_at(bytes, end + 10)?;
    let mut at = u32_at(bytes, end + 16)? as usize;
    let mut members = BTreeMap::new();
    for _ in 0..count {
        if !bytes.get(at..)?.starts_with(b"PK\x01\x02") {
            return None;
        }
        let method = u16_at(bytes, at + 10)?;
        let [packed, size] = [20, 24].map(|field| u32_at(bytes, at + field));
        let [name, extra, comment] = [28, 30, 32].map(|field| u16_at(bytes, at + field));
        let name_from = at + 46;
        let extra_from = name_from + usize::from(name?);
        let next = extra_from + usize::from(extra?) + usize::from(comment?);
        let wide = bytes.get(extra_from..extra_from + usize::from(extra?))?;
        let local = u32_at(bytes, at + 42)?;
        let [size, packed, local] = widened(wide, [size?, packed?, local])?;
        let name = String::from_utf8_lossy(bytes.get(name_from..extra_from)?).into_owned();
        let local = usize::try_from(local).ok()?;
        let lengths = [26, 28].map(|field| u16_at(bytes, local.saturating_add(field)));
        let from = local + 30 + usize::from(lengths[0]?) + usize::from(lengths[1]?);
        let to = from.checked_add(usize::try_from(packed).ok()?)?;
        let packed = bytes.get(from..to)?;
        if method == 0 || method == 8 {
            let deflated = method == 8;
            members.insert(
                name,
                Member {
                    packed,
                    deflated,
                    size,
                },
            );
        }
        at = next;
    }
    Some(members)
}

/// Sizes and offset, those that did not fit taken from the zip64 extra field, in this order.
fn widened(extra: &[u8], short: [u32; 3]) -> Option<[u64; 3]> {
    let mut at = 0;
    let mut field = None;
    while at + 4 <= extra.len() {
        let length = usize::from(u16_at(extra, at + 2)?);
        if u16_at(extra, at)? == 1 {
            field = extra.get(at + 4..at + 4 + length);
        }
        at += 4 + length;
    }
    let mut from = 0;
    let mut values = short.map(u64::from);
    for value in &mut values {
        if *value == u64::from(u32::MAX) {
            let eight = field?.get(from..from + 8)?;
            *value = u64::from_le_bytes(eight.try_into().ok()?);
            from += 8;
        }
    }
    Some(values)
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    let two = bytes.get(at..at.checked_add(2)?)?;
    Some(u16::from_le_bytes(two.try_into().ok()?))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(four.try_into().ok()?))
}

#[cfg(test)]
pub(crate) mod tests;

//! Positions and indices out of accessors, every reach checked.

use glam::Vec3;
use gltf::Accessor;
use gltf::accessor::{DataType, Dimensions, sparse};
use gltf::buffer::View;

use super::buffers::Buffers;
use super::{EXPORT_AGAIN, malformed};
use crate::mesh::colour_byte;
use crate::{Colour, Error};

/// Calls `take` with the bytes of each of `count` elements of `size` bytes in a view.
fn for_each(
    buffers: &mut Buffers<'_>,
    view: &View<'_>,
    [offset, count, size]: [usize; 3],
    what: &str,
    mut take: impl FnMut(usize, &[u8]),
) -> Result<(), Error> {
    if count == 0 {
        return Ok(());
    }
    let name = buffers.name();
    let stride = view.stride().unwrap_or(size);
    let bytes = buffers.view(view)?;
    let end = (count - 1)
        .checked_mul(stride)
        .and_then(|start| start.checked_add(size)?.checked_add(offset))
        .filter(|&end| end <= bytes.len());
    if end.is_none() || stride < size {
        let problem = format!(
            "{what} has {count} elements, more than fit into the {} bytes of buffer view {}",
            bytes.len(),
            view.index()
        );
        return Err(malformed(name, problem, EXPORT_AGAIN));
    }
    for (index, element) in bytes[offset..].chunks(stride).take(count).enumerate() {
        take(index, &element[..size]);
    }
    Ok(())
}

/// One number; normalised integers become fractions.
fn real(bytes: &[u8], kind: DataType, normalized: bool) -> f32 {
    let (value, most) = match kind {
        DataType::F32 => return f32::from_le_bytes(head(bytes)),
        DataType::I8 => (i8::from_le_bytes(head(bytes)) as f32, 127.0),
        DataType::U8 => (u8::from_le_bytes(head(bytes)) as f32, 255.0),
        DataType::I16 => (i16::from_le_bytes(head(bytes)) as f32, 32767.0),
        DataType::U16 => (u16::from_le_bytes(head(bytes)) as f32, 65535.0),
        DataType::U32 => (u32::from_le_bytes(head(bytes)) as f32, u32::MAX as f32),
    };
    if normalized { (value / most).max(-1.0) } else { value }
}

fn head<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.first_chunk().copied().unwrap_or([0; N])
}

fn whole(bytes: &[u8], kind: DataType) -> u32 {
    match kind {
        DataType::U8 | DataType::I8 => u32::from(u8::from_le_bytes(head(bytes))),
        DataType::U16 | DataType::I16 => u32::from(u16::from_le_bytes(head(bytes))),
        DataType::U32 | DataType::F32 => u32::from_le_bytes(head(bytes)),
    }
}

/// The three-component vectors of an accessor, sparse replacements included.
pub(super) fn positions(
    buffers: &mut Buffers<'_>,
    accessor: &Accessor<'_>,
) -> Result<Vec<Vec3>, Error> {
    let what = format!("accessor {}", accessor.index());
    if accessor.dimensions() != Dimensions::Vec3 {
        let problem = format!("the positions in {what} do not have three coordinates");
        return Err(malformed(buffers.name(), problem, EXPORT_AGAIN));
    }
    let (kind, normalized) = (accessor.data_type(), accessor.normalized());
    elements(buffers, accessor, Vec3::ZERO, |bytes| {
        let step = kind.size();
        let at = |axis: usize| real(bytes.get(axis * step..).unwrap_or(&[]), kind, normalized);
        Vec3::new(at(0), at(1), at(2))
    })
}

/// The colours of an accessor, of three components or four; integers are fractions of the largest one.
pub(super) fn colours(
    buffers: &mut Buffers<'_>,
    accessor: &Accessor<'_>,
) -> Result<Vec<Colour>, Error> {
    let has_alpha = accessor.dimensions() == Dimensions::Vec4;
    let kind = accessor.data_type();
    let fits = matches!(kind, DataType::F32 | DataType::U8 | DataType::U16);
    if !fits || !(has_alpha || accessor.dimensions() == Dimensions::Vec3) {
        let problem = format!("the colours in accessor {} are none", accessor.index());
        return Err(malformed(buffers.name(), problem, EXPORT_AGAIN));
    }
    elements(buffers, accessor, [0, 0, 0, if has_alpha { 0 } else { 255 }], |bytes| {
        let step = kind.size();
        let at = |i: usize| colour_byte(real(bytes.get(i * step..).unwrap_or(&[]), kind, true));
        [at(0), at(1), at(2), if has_alpha { at(3) } else { 255 }]
    })
}

/// The elements of an accessor, sparse replacements included; `zero` is what one is without data.
fn elements<T: Copy>(
    buffers: &mut Buffers<'_>,
    accessor: &Accessor<'_>,
    zero: T,
    element: impl Fn(&[u8]) -> T,
) -> Result<Vec<T>, Error> {
    let what = format!("accessor {}", accessor.index());
    let (count, size) = (accessor.count(), accessor.size());
    let mut all = Vec::new();
    match accessor.view() {
        Some(view) => {
            let shape = [accessor.offset(), count, size];
            for_each(buffers, &view, shape, &what, |_, bytes| all.push(element(bytes)))?;
        }
        // The caller has found the number believable.
        None => all.resize(count, zero),
    }
    if let Some(sparse) = accessor.sparse() {
        let mut places = Vec::new();
        let indices = sparse.indices();
        let kind = match indices.index_type() {
            sparse::IndexType::U8 => DataType::U8,
            sparse::IndexType::U16 => DataType::U16,
            sparse::IndexType::U32 => DataType::U32,
        };
        let shape = [indices.offset(), sparse.count(), kind.size()];
        for_each(buffers, &indices.view(), shape, &what, |_, bytes| {
            places.push(whole(bytes, kind))
        })?;
        let values = sparse.values();
        let shape = [values.offset(), sparse.count(), size];
        let mut stray = None;
        for_each(buffers, &values.view(), shape, &what, |at, bytes| {
            let place = places.get(at).copied().unwrap_or(u32::MAX);
            match all.get_mut(place as usize) {
                Some(old) => *old = element(bytes),
                None => stray = Some(place),
            }
        })?;
        if let Some(place) = stray {
            let problem = format!("{what} replaces element {place} of {count}");
            return Err(malformed(buffers.name(), problem, EXPORT_AGAIN));
        }
    }
    Ok(all)
}

/// The indices of an accessor.
pub(super) fn indices(
    buffers: &mut Buffers<'_>,
    accessor: &Accessor<'_>,
) -> Result<Vec<u32>, Error> {
    let what = format!("accessor {}", accessor.index());
    let kind = accessor.data_type();
    let fits = matches!(kind, DataType::U8 | DataType::U16 | DataType::U32)
        && accessor.dimensions() == Dimensions::Scalar;
    let (true, Some(view), None) = (fits, accessor.view(), accessor.sparse()) else {
        let problem = format!("{what} is not a plain list of unsigned indices");
        return Err(malformed(buffers.name(), problem, EXPORT_AGAIN));
    };
    let mut indices = Vec::new();
    let shape = [accessor.offset(), accessor.count(), kind.size()];
    for_each(buffers, &view, shape, &what, |_, bytes| indices.push(whole(bytes, kind)))?;
    Ok(indices)
}

//! Accessors (glTF 2.0, section 3.6.2): typed rows, read from the file's bytes whenever they are asked for.

use super::json;
use super::views::{Slice, Views, find};
use crate::scene::SceneError;

/// Type of a component (section 3.6.2.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    /// The type that the file writes as `code`.
    pub fn from_code(code: u32) -> Option<Component> {
        Some(match code {
            5120 => Component::I8,
            5121 => Component::U8,
            5122 => Component::I16,
            5123 => Component::U16,
            5125 => Component::U32,
            5126 => Component::F32,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }

    /// What stands for 1 in a normalized component (section 3.6.2.2 and KHR_mesh_quantization).
    pub fn one(self) -> f64 {
        match self {
            Component::I8 => 127.0,
            Component::U8 => 255.0,
            Component::I16 => 32767.0,
            Component::U16 => 65535.0,
            Component::U32 => f64::from(u32::MAX),
            Component::F32 => 1.0,
        }
    }

    /// The first component in `bytes`; 0 where they are too few.
    fn read(self, bytes: &[u8]) -> f64 {
        match self {
            Component::I8 => f64::from(i8::from_le_bytes(array(bytes))),
            Component::U8 => f64::from(u8::from_le_bytes(array(bytes))),
            Component::I16 => f64::from(i16::from_le_bytes(array(bytes))),
            Component::U16 => f64::from(u16::from_le_bytes(array(bytes))),
            Component::U32 => f64::from(u32::from_le_bytes(array(bytes))),
            Component::F32 => f64::from(f32::from_le_bytes(array(bytes))),
        }
    }
}

fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.first_chunk().copied().unwrap_or([0; N])
}

/// What an attribute may look like.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    /// Allowed `type`s.
    pub kinds: &'static [&'static str],
    /// Allowed component types.
    pub components: &'static [Component],
}

use Component::{F32, I8, I16, U8, U16, U32};

/// Positions and their morph displacements, quantized or not (KHR_mesh_quantization).
pub(super) const POSITION: Shape = Shape { kinds: &["VEC3"], components: &[F32, I8, U8, I16, U16] };
/// Texture coordinates, quantized or not.
pub(super) const TEXTURE_COORDINATES: Shape = Shape { kinds: &["VEC2"], components: &[F32, I8, U8, I16, U16] };
/// Vertex colours.
pub(super) const COLOUR: Shape = Shape { kinds: &["VEC3", "VEC4"], components: &[F32, U8, U16] };
/// Joint numbers of a skin.
pub(super) const JOINTS: Shape = Shape { kinds: &["VEC4"], components: &[U8, U16] };
/// Joint weights of a skin.
pub(super) const WEIGHTS: Shape = Shape { kinds: &["VEC4"], components: &[F32, U8, U16] };
/// Vertex numbers.
pub(super) const INDICES: Shape = Shape { kinds: &["SCALAR"], components: &[U8, U16, U32] };
/// Inverse bind matrices.
pub(super) const MATRIX: Shape = Shape { kinds: &["MAT4"], components: &[F32] };
/// Translation or scale of instances.
pub(super) const VECTOR: Shape = Shape { kinds: &["VEC3"], components: &[F32] };
/// Rotation of instances (EXT_mesh_gpu_instancing).
pub(super) const ROTATION: Shape = Shape { kinds: &["VEC4"], components: &[F32, I8, I16] };

/// A claim of rows that no byte backs costs time, if no memory, so it has a bound.
const MOST_ROWS_WITHOUT_BYTES: usize = 1 << 24;

/// The rows of a checked accessor.
#[derive(Clone, Debug)]
pub(super) struct Elements {
    /// `None` stands for zeros (section 3.6.2.3).
    base: Option<Slice>,
    stride: usize,
    component: Component,
    width: usize,
    normalized: bool,
    count: usize,
    sparse: Option<Box<SparseRows>>,
}

#[derive(Clone, Debug)]
struct SparseRows {
    count: usize,
    indices: Elements,
    values: Elements,
}

impl SparseRows {
    /// The substitute of row `index`. Binary search: indices increase strictly, which is checked when the file is read.
    fn substitute(&self, index: usize) -> Option<usize> {
        let (mut low, mut high) = (0, self.count);
        while low < high {
            let middle = low + (high - low) / 2;
            match (self.indices.unsigned(middle) as usize).cmp(&index) {
                std::cmp::Ordering::Equal => return Some(middle),
                std::cmp::Ordering::Less => low = middle + 1,
                std::cmp::Ordering::Greater => high = middle,
            }
        }
        None
    }
}

impl Elements {
    /// Rows of `width` 32-bit floats that a decoder has produced.
    pub fn from_floats(values: Slice, width: usize) -> Elements {
        Elements::decoded(values, width, F32)
    }

    /// 32-bit indices that a decoder has produced.
    pub fn from_indices(values: Slice) -> Elements {
        Elements::decoded(values, 1, U32)
    }

    fn decoded(values: Slice, width: usize, component: Component) -> Elements {
        let stride = (width * component.bytes()).max(1);
        let count = values.get().len() / stride;
        Elements { base: Some(values), stride, component, width, normalized: false, count, sparse: None }
    }

    /// Number of rows.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Number of components in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Whether no byte of the file stands behind the rows.
    pub fn is_unbacked(&self) -> bool {
        self.base.is_none()
    }

    /// Integers read as colours or weights are meant normalized whether the file says so or not.
    pub fn normalized(mut self) -> Elements {
        self.normalized = true;
        if let Some(sparse) = &mut self.sparse {
            sparse.values.normalized = true;
        }
        self
    }

    /// Row `index` as numbers; components that the row lacks are 0.
    pub fn floats<const N: usize>(&self, index: usize) -> [f64; N] {
        if let Some(sparse) = &self.sparse
            && let Some(substitute) = sparse.substitute(index)
        {
            return sparse.values.floats(substitute);
        }
        let mut row = [0.0; N];
        let size = self.component.bytes();
        for (value, bytes) in row.iter_mut().zip(self.row(index).chunks_exact(size)) {
            let read = self.component.read(bytes);
            // A signed component has one value below −1, which counts as −1 (section 3.6.2.2).
            *value = if self.normalized { (read / self.component.one()).max(-1.0) } else { read };
        }
        row
    }

    /// Row `index` as a number without sign.
    pub fn unsigned(&self, index: usize) -> u32 {
        if let Some(sparse) = &self.sparse
            && let Some(substitute) = sparse.substitute(index)
        {
            return sparse.values.unsigned(substitute);
        }
        let bytes = self.row(index);
        match self.component {
            U8 => u32::from(u8::from_le_bytes(array(bytes))),
            U16 => u32::from(u16::from_le_bytes(array(bytes))),
            _ => u32::from_le_bytes(array(bytes)),
        }
    }

    fn row(&self, index: usize) -> &[u8] {
        let Some(base) = &self.base else { return &[] };
        let start = index * self.stride;
        base.get().get(start..start + self.width * self.component.bytes()).unwrap_or_default()
    }
}

impl Views<'_> {
    /// The rows of accessor `index`, which the property at JSON path `referrer` names.
    pub fn elements(&mut self, index: u32, referrer: &str, shape: Shape) -> Result<Elements, SceneError> {
        let document = self.document;
        let accessor = find(&document.accessors, index)
            .ok_or_else(|| self.index_error(referrer, "accessor", index, document.accessors.len()))?;
        let path = format!("accessors[{index}]");
        let component = self.component(accessor.component_type, &path, shape.components, referrer)?;
        let width = self.width(accessor, &path, shape, referrer)?;
        let count = usize::try_from(accessor.count).map_err(|_| {
            self.error(&format!("{path}.count"), accessor.count.to_string(), "a count that fits in memory")
        })?;
        let mut elements =
            Elements { base: None, stride: 0, component, width, normalized: accessor.normalized, count, sparse: None };
        if let Some(view) = accessor.buffer_view {
            let stride = find(&document.buffer_views, view).and_then(|view| view.byte_stride);
            let rows =
                self.rows(view, &path, accessor.byte_offset, stride, accessor.count, width * component.bytes())?;
            (elements.base, elements.stride) = (Some(rows.0), rows.1);
        }
        if accessor.buffer_view.is_none() && count > MOST_ROWS_WITHOUT_BYTES {
            let expected = format!("a buffer view, or at most {MOST_ROWS_WITHOUT_BYTES} rows of zeros");
            return Err(self.error(&path, format!("{count} rows without a buffer view"), expected));
        }
        if let Some(sparse) = &accessor.sparse {
            elements.sparse = Some(Box::new(self.sparse(sparse, &path, &elements)?));
        }
        Ok(elements)
    }

    fn component(&self, code: u32, path: &str, allowed: &[Component], referrer: &str) -> Result<Component, SceneError> {
        Component::from_code(code).filter(|component| allowed.contains(component)).ok_or_else(|| {
            self.error(&format!("{path}.componentType"), code.to_string(), format!("one of {allowed:?} for {referrer}"))
        })
    }

    fn width(&self, accessor: &json::Accessor, path: &str, shape: Shape, referrer: &str) -> Result<usize, SceneError> {
        let width = match accessor.kind.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            "MAT4" => 16,
            _ => 0,
        };
        if width == 0 || !shape.kinds.contains(&accessor.kind.as_str()) {
            let expected = format!("{} for {referrer}", shape.kinds.join(" or "));
            return Err(self.error(&format!("{path}.type"), format!("{:?}", accessor.kind), expected));
        }
        Ok(width)
    }

    /// `count` rows of `size` bytes from `offset` on in buffer view `view`, and their distance.
    fn rows(
        &mut self,
        view: u32,
        path: &str,
        offset: u64,
        stride: Option<u64>,
        count: u64,
        size: usize,
    ) -> Result<(Slice, usize), SceneError> {
        let slice = self.view(view, &format!("{path}.bufferView"))?;
        let size = size as u64;
        let stride = stride.unwrap_or(size);
        if stride < size {
            let at = format!("bufferViews[{view}].byteStride");
            return Err(self.error(&at, stride.to_string(), format!("at least {size}, the size of a row of {path}")));
        }
        // Section 3.6.2.4: the last row need not be followed by padding.
        let length = match count.checked_sub(1) {
            None => Some(0),
            Some(last) => last.checked_mul(stride).and_then(|bytes| bytes.checked_add(size)),
        };
        let rows = length.and_then(|length| slice.part(offset, length)).ok_or_else(|| {
            self.error(
                path,
                format!("{count} rows, {stride} bytes apart, from byte {offset} on"),
                format!("rows inside buffer view {view}, which has {} bytes", slice.get().len()),
            )
        })?;
        let stride = usize::try_from(stride).unwrap_or(usize::MAX);
        // With a single row the stride may be anything, so keep it from overflowing.
        Ok((rows, if count <= 1 { size as usize } else { stride }))
    }

    fn sparse(&mut self, sparse: &json::Sparse, path: &str, elements: &Elements) -> Result<SparseRows, SceneError> {
        let path = format!("{path}.sparse");
        let indices_path = format!("{path}.indices");
        let code = sparse.indices.component_type;
        let component = self.component(code, &indices_path, INDICES.components, &path)?;
        let index = &sparse.indices;
        let (base, stride) =
            self.rows(index.buffer_view, &indices_path, index.byte_offset, None, sparse.count, component.bytes())?;
        // The rows lie inside the file, so their number fits.
        let count = usize::try_from(sparse.count).unwrap_or(usize::MAX);
        let indices =
            Elements { base: Some(base), stride, component, width: 1, normalized: false, count, sparse: None };
        let mut least = 0_u64;
        for row in 0..count {
            let value = indices.unsigned(row);
            if u64::from(value) < least || value as usize >= elements.count {
                let expected = format!("indices that increase strictly and stay below {}", elements.count);
                return Err(self.error(&format!("{indices_path}[{row}]"), value.to_string(), expected));
            }
            least = u64::from(value) + 1;
        }
        let size = elements.width * elements.component.bytes();
        let values = &sparse.values;
        let (base, stride) =
            self.rows(values.buffer_view, &format!("{path}.values"), values.byte_offset, None, sparse.count, size)?;
        let values = Elements { base: Some(base), stride, count, ..elements.clone() };
        Ok(SparseRows { count, indices, values })
    }
}

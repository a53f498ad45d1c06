//! Connected pieces of voxels.

/// A connected piece: voxels that share faces.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Component {
    /// Its first voxel, `[z][y][x]` order.
    pub first: usize,
    /// Voxels.
    pub size: usize,
}

/// Labels the face-connected pieces of `solid`: a label a voxel (`u32::MAX` where empty) and the pieces, in the order of
/// their first voxels.
pub fn components(dims: [usize; 3], solid: &[bool]) -> (Vec<u32>, Vec<Component>) {
    let [nx, ny, nz] = dims;
    let mut labels = vec![u32::MAX; solid.len()];
    let mut pieces = Vec::new();
    let mut stack = Vec::new();
    for first in 0..solid.len() {
        if !solid[first] || labels[first] != u32::MAX {
            continue;
        }
        let label = pieces.len() as u32;
        let mut size = 0;
        labels[first] = label;
        stack.push(first);
        while let Some(v) = stack.pop() {
            size += 1;
            let at = [v % nx, v / nx % ny, v / (nx * ny)];
            for (d, (stride, n)) in [(1, nx), (nx, ny), (nx * ny, nz)].into_iter().enumerate() {
                let below = (at[d] > 0).then(|| v - stride);
                let above = (at[d] + 1 < n).then(|| v + stride);
                for w in below.into_iter().chain(above) {
                    if solid[w] && labels[w] == u32::MAX {
                        labels[w] = label;
                        stack.push(w);
                    }
                }
            }
        }
        pieces.push(Component { first, size });
    }
    (labels, pieces)
}

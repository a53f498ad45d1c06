//! Saved states: an interrupted run goes on where it was.

use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{Mma, OptimizeOptions, Problem, TopoptError};
use crate::io::{IoError, atomic_write};

/// Everything that the next iteration needs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    /// Iterations done.
    pub iteration: usize,
    /// Variables, one a design voxel.
    pub x: Vec<f64>,
    /// Densities of the last iteration, one a design voxel.
    pub rho: Vec<f64>,
    /// Compliance of the first and of the last iteration.
    pub compliance: [f64; 2],
    /// Iterations in a row below the stopping limits.
    pub quiet: usize,
    /// Asymptotes.
    pub mma: Mma,
}

#[derive(Serialize, Deserialize)]
struct Header {
    problem: String,
    iteration: usize,
    compliance: [f64; 2],
    quiet: usize,
    lengths: Vec<usize>,
}

impl State {
    /// Writes the state; `problem` and `options` are kept as a hash.
    ///
    /// # Errors
    /// [`IoError::Write`].
    pub fn save(
        &self,
        path: &Path,
        problem: &Problem,
        options: &OptimizeOptions,
    ) -> Result<(), IoError> {
        let (steps, reach) = (&self.mma.steps, &self.mma.reach);
        let header = Header {
            problem: fingerprint(problem, options),
            iteration: self.iteration,
            compliance: self.compliance,
            quiet: self.quiet,
            lengths: vec![self.x.len(), self.rho.len(), reach.len(), steps.len()],
        };
        atomic_write(path, |out| {
            serde_json::to_writer(&mut *out, &header)?;
            out.write_all(b"\n")?;
            for value in self.x.iter().chain(&self.rho) {
                out.write_all(&value.to_le_bytes())?;
            }
            for value in reach {
                out.write_all(&value.to_le_bytes())?;
            }
            for value in steps {
                out.write_all(&value.to_le_bytes())?;
            }
            Ok(())
        })
    }

    /// Reads a state of the same problem.
    ///
    /// # Errors
    /// [`TopoptError::State`] when it is damaged or of another problem; [`TopoptError::Io`].
    pub fn load(
        path: &Path,
        problem: &Problem,
        options: &OptimizeOptions,
    ) -> Result<Self, TopoptError> {
        let bytes = crate::io::read_file(path, u64::MAX / 2)?;
        let bad = |what: &str| TopoptError::State {
            file: path.display().to_string(),
            what: what.to_owned(),
        };
        let end = bytes
            .iter()
            .position(|&b| b == b'\n')
            .ok_or_else(|| bad("it has no header"))?;
        let header: Header =
            serde_json::from_slice(&bytes[..end]).map_err(|e| bad(&e.to_string()))?;
        if header.problem != fingerprint(problem, options) {
            return Err(bad("its voxels, loads or options differ"));
        }
        let n = problem.design().count();
        let data = &bytes[end + 1..];
        let fits = matches!(header.lengths[..], [x, rho, reach, steps]
            if [x, rho] == [n, n] && reach == steps && (reach == 0 || reach == n));
        let reach = header.lengths.get(2).copied().unwrap_or(0);
        if !fits || data.len() != 16 * n + 5 * reach {
            return Err(bad("it is damaged"));
        }
        let (variables, asymptotes) = data.split_at(16 * n);
        let (reach, steps) = asymptotes.split_at(4 * reach);
        let mut variables = variables
            .as_chunks()
            .0
            .iter()
            .map(|&b| f64::from_le_bytes(b));
        Ok(Self {
            iteration: header.iteration,
            compliance: header.compliance,
            quiet: header.quiet,
            x: variables.by_ref().take(n).collect(),
            rho: variables.collect(),
            mma: Mma {
                steps: steps.iter().map(|&s| i8::from_le_bytes([s])).collect(),
                reach: reach
                    .as_chunks()
                    .0
                    .iter()
                    .map(|&b| f32::from_le_bytes(b))
                    .collect(),
                ..Mma::default()
            },
        })
    }
}

/// SHA-256 of what the variables mean; the number of iterations may change.
fn fingerprint(problem: &Problem, options: &OptimizeOptions) -> String {
    let mut hash = Sha256::new();
    hash.update(&problem.labels);
    let options = OptimizeOptions {
        max_iterations: 0,
        save_every: 0,
        ..options.clone()
    };
    let rest = format!(
        "{:?} {:?} {} {} {} {:?} {:?} {options:?}",
        problem.dims,
        problem.origin,
        problem.h,
        problem.young,
        problem.nu,
        problem.fixed,
        problem.cases
    );
    hash.update(rest.as_bytes());
    hash.finalize().iter().map(|b| format!("{b:02x}")).collect()
}

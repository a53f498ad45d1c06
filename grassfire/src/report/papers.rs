//! The papers whose methods a run used; keys as in `references.bib`.

/// One paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Paper {
    /// Key in `references.bib`.
    pub key: &'static str,
    /// Authors, year, title, where.
    pub citation: &'static str,
    /// Digital object identifier; empty when there is none.
    pub doi: &'static str,
    /// Stages that use it, as named in `report.json`.
    pub stages: &'static [&'static str],
    /// What we took from it.
    pub used_for: &'static str,
}

/// All papers, in the order of the stages.
pub const ALL: &[Paper] = &[
    Paper {
        key: "mayer2023",
        citation: "J. Mayer, M. Denk, S. Wartzack (2023): Reconstruction of topology optimized geometry with casting constraints in a feature-based approach. Proceedings of the Design Society 3 (ICED23).",
        doi: "10.1017/pds.2023.302",
        stages: &["medial", "skeleton", "thicken"],
        used_for: "the chain from a mesh over its medial axis to an editable, thickened quad skeleton",
    },
    Paper {
        key: "blum1967",
        citation: "H. Blum (1967): A transformation for extracting new descriptors of shape. In: Models for the Perception of Speech and Visual Form, MIT Press.",
        doi: "",
        stages: &["medial"],
        used_for: "the medial axis, and the name",
    },
    Paper {
        key: "barill2018",
        citation: "G. Barill, N. G. Dickson, R. Schmidt, D. I. W. Levin, A. Jacobson (2018): Fast winding numbers for soups and clouds. ACM Transactions on Graphics 37(4).",
        doi: "10.1145/3197517.3201337",
        stages: &["read", "remesh"],
        used_for: "inside and outside of dirty meshes",
    },
    Paper {
        key: "schnabel2007",
        citation: "R. Schnabel, R. Wahl, R. Klein (2007): Efficient RANSAC for point-cloud shape detection. Computer Graphics Forum 26(2).",
        doi: "10.1111/j.1467-8659.2007.01016.x",
        stages: &["recognise"],
        used_for: "planes and cylinders in the proposal",
    },
    Paper {
        key: "ma2012",
        citation: "J. Ma, S. W. Bae, S. Choi (2012): 3D medial axis point approximation using nearest neighbors and the normal field. The Visual Computer 28(1).",
        doi: "10.1007/s00371-011-0594-7",
        stages: &["mould"],
        used_for: "balls in walls and in the sand beside them: fillets, gaps, junctions",
    },
    Paper {
        key: "lorensen1987",
        citation: "W. E. Lorensen, H. E. Cline (1987): Marching cubes: a high resolution 3D surface construction algorithm. ACM SIGGRAPH Computer Graphics 21(4).",
        doi: "10.1145/37402.37422",
        stages: &["optimize"],
        used_for: "the raw proposal of a drawn part",
    },
    Paper {
        key: "zhao2005",
        citation: "H. Zhao (2005): A fast sweeping method for Eikonal equations. Mathematics of Computation 74.",
        doi: "10.1090/S0025-5718-04-01678-3",
        stages: &["remesh"],
        used_for: "distances far from the surface",
    },
    Paper {
        key: "bertrand1994",
        citation: "G. Bertrand, G. Malandain (1994): A new characterization of three-dimensional simple points. Pattern Recognition Letters 15(2).",
        doi: "10.1016/0167-8655(94)90046-9",
        stages: &["remesh"],
        used_for: "voxels that can change without changing the topology",
    },
    Paper {
        key: "nielson2004",
        citation: "G. M. Nielson (2004): Dual marching cubes. IEEE Visualization.",
        doi: "10.1109/VISUAL.2004.28",
        stages: &["remesh"],
        used_for: "closed manifold surfaces from voxels",
    },
    Paper {
        key: "ju2002",
        citation: "T. Ju, F. Losasso, S. Schaefer, J. Warren (2002): Dual contouring of Hermite data. ACM Transactions on Graphics 21(3).",
        doi: "10.1145/566654.566586",
        stages: &["remesh"],
        used_for: "placing surface points on features",
    },
    Paper {
        key: "bowyer1981",
        citation: "A. Bowyer (1981): Computing Dirichlet tessellations. The Computer Journal 24(2).",
        doi: "10.1093/comjnl/24.2.162",
        stages: &["poles", "medial"],
        used_for: "incremental Delaunay triangulation",
    },
    Paper {
        key: "watson1981",
        citation: "D. F. Watson (1981): Computing the n-dimensional Delaunay tessellation with application to Voronoi polytopes. The Computer Journal 24(2).",
        doi: "10.1093/comjnl/24.2.167",
        stages: &["poles", "medial"],
        used_for: "incremental Delaunay triangulation",
    },
    Paper {
        key: "shewchuk1997",
        citation: "J. R. Shewchuk (1997): Adaptive precision floating-point arithmetic and fast robust geometric predicates. Discrete & Computational Geometry 18.",
        doi: "10.1007/PL00009321",
        stages: &["poles", "medial"],
        used_for: "exact predicates",
    },
    Paper {
        key: "amenta2001",
        citation: "N. Amenta, S. Choi, R. K. Kolluri (2001): The power crust, unions of balls, and the medial axis transform. Computational Geometry 19.",
        doi: "10.1016/S0925-7721(01)00017-7",
        stages: &["poles"],
        used_for: "poles and local feature size",
    },
    Paper {
        key: "yan2016",
        citation: "Y. Yan, K. Sykes, E. Chambers, D. Letscher, T. Ju (2016): Erosion thickness on medial axes of 3D shapes. ACM Transactions on Graphics 35(4).",
        doi: "10.1145/2897824.2925938",
        stages: &["medial"],
        used_for: "burn order: which parts of the medial axis matter",
    },
    Paper {
        key: "yan2018",
        citation: "Y. Yan, D. Letscher, T. Ju (2018): Voxel cores: efficient, robust, and provably good approximation of 3D medial axes. ACM Transactions on Graphics 37(4).",
        doi: "10.1145/3197517.3201396",
        stages: &["medial"],
        used_for: "a medial axis with the topology of the voxel solid",
    },
    Paper {
        key: "li2015",
        citation: "P. Li, B. Wang, F. Sun, X. Guo, C. Zhang, W. Wang (2015): Q-MAT: computing medial axis transform by quadratic error minimization. ACM Transactions on Graphics 35(1).",
        doi: "10.1145/2753755",
        stages: &["medial"],
        used_for: "medial spheres fitted to the smooth surface",
    },
    Paper {
        key: "dey1999",
        citation: "T. K. Dey, H. Edelsbrunner, S. Guha, D. V. Nekhayev (1999): Topology preserving edge contraction. Publications de l'Institut Mathématique (Beograd) 66.",
        doi: "",
        stages: &["skeleton"],
        used_for: "the link condition: contractions that keep the topology",
    },
    Paper {
        key: "taubin1995",
        citation: "G. Taubin (1995): A signal processing approach to fair surface design. SIGGRAPH.",
        doi: "10.1145/218380.218473",
        stages: &["skeleton"],
        used_for: "smooth seams and rims that do not shrink",
    },
    Paper {
        key: "bouaziz2012",
        citation: "S. Bouaziz, M. Deuss, Y. Schwartzburg, T. Weise, M. Pauly (2012): Shape-up: shaping discrete geometry with projections. Computer Graphics Forum 31(5).",
        doi: "10.1111/j.1467-8659.2012.03171.x",
        stages: &["skeleton"],
        used_for: "quads that are nearly squares",
    },
    Paper {
        key: "wang2008",
        citation: "W. Wang, B. Jüttler, D. Zheng, Y. Liu (2008): Computation of rotation minimizing frames. ACM Transactions on Graphics 27(1).",
        doi: "10.1145/1330511.1330513",
        stages: &["thicken"],
        used_for: "beams without twist",
    },
    Paper {
        key: "catmull1978",
        citation: "E. Catmull, J. Clark (1978): Recursively generated B-spline surfaces on arbitrary topological meshes. Computer-Aided Design 10(6).",
        doi: "10.1016/0010-4485(78)90110-0",
        stages: &["fit"],
        used_for: "the surface of a quad control mesh",
    },
    Paper {
        key: "halstead1993",
        citation: "M. Halstead, M. Kass, T. DeRose (1993): Efficient, fair interpolation using Catmull-Clark surfaces. SIGGRAPH.",
        doi: "10.1145/166117.166121",
        stages: &["fit"],
        used_for: "fitting the limit surface with a fairness term",
    },
    Paper {
        key: "loop2008",
        citation: "C. Loop, S. Schaefer (2008): Approximating Catmull-Clark subdivision surfaces with bicubic patches. ACM Transactions on Graphics 27(1).",
        doi: "10.1145/1330511.1330519",
        stages: &["spline"],
        used_for: "first and second order data of the patches",
    },
    Paper {
        key: "eppstein2008",
        citation: "D. Eppstein, M. T. Goodrich, E. Kim, R. Tamstorf (2008): Motorcycle graphs: canonical quad mesh partitioning. Computer Graphics Forum 27(5).",
        doi: "10.1111/j.1467-8659.2008.01288.x",
        stages: &["spline"],
        used_for: "few large faces from many patches",
    },
    Paper {
        key: "andrade2012",
        citation: "D. V. Andrade, M. G. C. Resende, R. F. Werneck (2012): Fast local search for the maximum independent set problem. Journal of Heuristics 18.",
        doi: "10.1007/s10732-012-9196-4",
        stages: &["spline"],
        used_for: "which borders between faces can go",
    },
    Paper {
        key: "wlodawer1966",
        citation: "R. Wlodawer (1966): Directional Solidification of Steel Castings. Pergamon Press.",
        doi: "",
        stages: &["feed"],
        used_for: "the circle method of A. Heuvers (1929), known to us through foundry handbooks: sections grow towards the feeder; moduli of feeder and neck",
    },
    Paper {
        key: "niyama1982",
        citation: "E. Niyama, T. Uchida, M. Morikawa, S. Saito (1982): A method of shrinkage prediction and its application to steel casting practice. AFS International Cast Metals Journal 7.",
        doi: "",
        stages: &["solidify"],
        used_for: "the criterion G / sqrt(R) near the end of freezing",
    },
    Paper {
        key: "ahn2002",
        citation: "H.-K. Ahn, M. de Berg, P. Bose, S.-W. Cheng, D. Halperin, J. Matousek, O. Schwarzkopf (2002): Separating an object from its cast. Computer-Aided Design 34.",
        doi: "",
        stages: &["mould"],
        used_for: "a mould opens along a direction when every line along it meets the part in one interval",
    },
    Paper {
        key: "bendsoe1999",
        citation: "M. P. Bendsoe, O. Sigmund (1999): Material interpolation schemes in topology optimization. Archive of Applied Mechanics 69.",
        doi: "10.1007/s004190050248",
        stages: &["optimize"],
        used_for: "penalized densities",
    },
    Paper {
        key: "bruyneel2005",
        citation: "M. Bruyneel, P. Duysinx (2005): Note on topology optimization of continuum structures including self-weight. Structural and Multidisciplinary Optimization 29.",
        doi: "10.1007/s00158-004-0484-y",
        stages: &["optimize"],
        used_for: "what gravity does to thin material",
    },
    Paper {
        key: "tang2009",
        citation: "J. M. Tang, R. Nabben, C. Vuik, Y. A. Erlangga (2009): Comparison of two-level preconditioners derived from deflation, domain decomposition and multigrid methods. Journal of Scientific Computing 39.",
        doi: "10.1007/s10915-009-9272-6",
        stages: &["optimize", "verify"],
        used_for: "rigid motions on soft springs",
    },
    Paper {
        key: "zhu2009",
        citation: "J. Zhu, W. Zhang, P. Beckers (2009): Integrated layout design of multi-component system. International Journal for Numerical Methods in Engineering 78.",
        doi: "10.1002/nme.2499",
        stages: &["optimize"],
        used_for: "moduli of thin material under gravity",
    },
    Paper {
        key: "bruns2001",
        citation: "T. E. Bruns, D. A. Tortorelli (2001): Topology optimization of non-linear elastic structures and compliant mechanisms. Computer Methods in Applied Mechanics and Engineering 190.",
        doi: "10.1016/S0045-7825(00)00278-4",
        stages: &["optimize"],
        used_for: "the density filter",
    },
    Paper {
        key: "lazarov2011",
        citation: "B. S. Lazarov, O. Sigmund (2011): Filters in topology optimization based on Helmholtz-type differential equations. International Journal for Numerical Methods in Engineering 86.",
        doi: "10.1002/nme.3072",
        stages: &["optimize"],
        used_for: "the density filter for large radii",
    },
    Paper {
        key: "wang2011",
        citation: "F. Wang, B. S. Lazarov, O. Sigmund (2011): On projection methods, convergence and robust formulations in topology optimization. Structural and Multidisciplinary Optimization 43.",
        doi: "10.1007/s00158-010-0602-y",
        stages: &["optimize"],
        used_for: "densities that are nearly 0 or 1",
    },
    Paper {
        key: "svanberg1987",
        citation: "K. Svanberg (1987): The method of moving asymptotes - a new method for structural optimization. International Journal for Numerical Methods in Engineering 24.",
        doi: "10.1002/nme.1620240207",
        stages: &["optimize"],
        used_for: "the update of the variables",
    },
    Paper {
        key: "bendsoe1989",
        citation: "M. P. Bendsoe (1989): Optimal shape design as a material distribution problem. Structural Optimization 1.",
        doi: "10.1007/BF01650949",
        stages: &["optimize"],
        used_for: "optimality criteria",
    },
    Paper {
        key: "adams2003",
        citation: "M. Adams, M. Brezina, J. Hu, R. Tuminaro (2003): Parallel multigrid smoothing: polynomial versus Gauss-Seidel. Journal of Computational Physics 188.",
        doi: "10.1016/S0021-9991(03)00194-3",
        stages: &["optimize", "verify"],
        used_for: "the smoother of the multigrid solver",
    },
    Paper {
        key: "parvizian2007",
        citation: "J. Parvizian, A. Duester, E. Rank (2007): Finite cell method: h- and p-extension for embedded domain problems in solid mechanics. Computational Mechanics 41.",
        doi: "10.1007/s00466-007-0173-y",
        stages: &["verify"],
        used_for: "voxels that a surface cuts count by their share of material",
    },
    Paper {
        key: "dunavant1985",
        citation: "D. A. Dunavant (1985): High degree efficient symmetrical Gaussian quadrature rules for the triangle. International Journal for Numerical Methods in Engineering 21.",
        doi: "10.1002/nme.1620210612",
        stages: &["tetrahedra"],
        used_for: "loads on the curved faces of tetrahedra",
    },
    Paper {
        key: "kirkpatrick1983",
        citation: "S. Kirkpatrick, C. D. Gelatt, M. P. Vecchi (1983): Optimization by simulated annealing. Science 220.",
        doi: "10.1126/science.220.4598.671",
        stages: &["skeleton"],
        used_for: "quads of the skeleton with few irregular vertices",
    },
];

/// The papers behind `stages`, in the order of [`ALL`].
pub fn of_stages<'a>(stages: impl IntoIterator<Item = &'a str>) -> Vec<&'static Paper> {
    let names: Vec<&str> = stages.into_iter().collect();
    ALL.iter()
        .filter(|paper| paper.stages.iter().any(|stage| names.contains(stage)))
        .collect()
}

/// The paper with `key`.
pub fn find(key: &str) -> Option<&'static Paper> {
    ALL.iter().find(|paper| paper.key == key)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_and_bibliography_agree() {
        let bib = include_str!("../../../references.bib");
        let entries = bib.lines().filter(|line| line.starts_with('@')).count();
        assert_eq!(entries, ALL.len());
        for paper in ALL {
            assert!(
                bib.contains(&format!("{{{},", paper.key)),
                "{} is missing",
                paper.key
            );
            assert!(
                paper.doi.is_empty() || bib.contains(&format!("{{{}}}", paper.doi)),
                "{}",
                paper.doi
            );
        }
    }

    #[test]
    fn stages_pick_their_papers() {
        let keys: Vec<&str> = of_stages(["spline"])
            .iter()
            .map(|paper| paper.key)
            .collect();
        assert_eq!(keys, ["loop2008", "eppstein2008", "andrade2012"]);
        assert!(find("yan2018").is_some() && find("nobody").is_none());
    }
}

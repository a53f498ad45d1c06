//! Finds OpenCASCADE and compiles the C++ side of the bridge.
//!
//! `OCCT_ROOT` (with `include/opencascade` or `include`, and `lib`) or, without it, the system's packages.

use std::path::{Path, PathBuf};
use std::{env, fs, process};

const INSTALL: &str = "apt-get install -y --no-install-recommends libocct-foundation-dev libocct-modeling-data-dev \
                       libocct-modeling-algorithms-dev libocct-data-exchange-dev libocct-ocaf-dev";

fn main() {
    println!("cargo:rerun-if-env-changed=OCCT_ROOT");
    for file in [
        "cpp/bridge.h",
        "cpp/build.cpp",
        "cpp/boolean.cpp",
        "cpp/fillet.cpp",
        "cpp/query.cpp",
        "cpp/exchange.cpp",
        "cpp/tessellate.cpp",
    ] {
        println!("cargo:rerun-if-changed={file}");
    }
    let (include, library) = locate();
    let (major, minor) = version(&include).unwrap_or_else(|| missing(&include));

    cxx_build::bridge("src/ffi.rs")
        .files([
            "cpp/build.cpp",
            "cpp/boolean.cpp",
            "cpp/fillet.cpp",
            "cpp/query.cpp",
            "cpp/exchange.cpp",
            "cpp/tessellate.cpp",
        ])
        // Not our headers: no warnings about them.
        .flag(format!("-isystem{}", include.display()))
        .std("c++17")
        .flag_if_supported("-Wno-deprecated-declarations")
        .compile("grassfire_occt");

    if let Some(library) = library {
        println!("cargo:rustc-link-search=native={}", library.display());
        println!("cargo:rustc-link-arg=-Wl,-rpath,{}", library.display());
    }
    // The toolkits for files were renamed in 7.8.
    let exchange: &[&str] = if (major, minor) >= (7, 8) {
        &["TKDEIGES", "TKDESTEP", "TKDE", "TKXSBase"]
    } else {
        &[
            "TKIGES",
            "TKXDESTEP",
            "TKSTEP",
            "TKSTEPAttr",
            "TKSTEP209",
            "TKSTEPBase",
            "TKXSBase",
        ]
    };
    let modelling = [
        "TKXCAF",
        "TKLCAF",
        "TKCDF",
        "TKFillet",
        "TKBO",
        "TKBool",
        "TKPrim",
        "TKMesh",
        "TKShHealing",
        "TKTopAlgo",
        "TKGeomAlgo",
        "TKBRep",
        "TKGeomBase",
        "TKG3d",
        "TKG2d",
        "TKMath",
        "TKernel",
    ];
    for name in exchange.iter().chain(&modelling) {
        println!("cargo:rustc-link-lib=dylib={name}");
    }
}

/// Folder of the headers and, unless it is the system's own, folder of the libraries.
fn locate() -> (PathBuf, Option<PathBuf>) {
    let Some(root) = env::var_os("OCCT_ROOT").map(PathBuf::from) else {
        return (PathBuf::from("/usr/include/opencascade"), None);
    };
    let nested = root.join("include/opencascade");
    let include = if nested.exists() {
        nested
    } else {
        root.join("include")
    };
    (include, Some(root.join("lib")))
}

fn version(include: &Path) -> Option<(u32, u32)> {
    let text = fs::read_to_string(include.join("Standard_Version.hxx")).ok()?;
    let number = |name: &str| {
        let line = text
            .lines()
            .find(|l| l.starts_with("#define") && l.split_whitespace().nth(1) == Some(name))?;
        line.split_whitespace().nth(2)?.parse().ok()
    };
    Some((number("OCC_VERSION_MAJOR")?, number("OCC_VERSION_MINOR")?))
}

fn missing(include: &Path) -> ! {
    eprintln!("error: no OpenCASCADE headers in {}", include.display());
    eprintln!("hint: {INSTALL}");
    eprintln!(
        "hint: or set OCCT_ROOT to an installation, or build without CAD output: cargo build --no-default-features"
    );
    process::exit(1);
}

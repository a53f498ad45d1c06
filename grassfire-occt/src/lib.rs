//! Thin bridge to OpenCASCADE: the only unsafe code of the project.

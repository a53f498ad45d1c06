//! CAD stage: B-rep -> OpenCASCADE solid, united with the non-design bodies, checked, written as STEP.

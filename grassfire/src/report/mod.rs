//! report.json and report.html with rendered pictures.

//! The report: words, pictures and figures for a person.

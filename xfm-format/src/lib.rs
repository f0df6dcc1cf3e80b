//! The .xfm file: a pageable merge-tree forest, its writer, reader and verifier.

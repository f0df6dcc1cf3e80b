//! Merge-tree forests of half-edge collapses and their view-dependent active front.

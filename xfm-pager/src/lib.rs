//! Pages the nodes of a .xfm file in and out under a memory quota.

//! Triangle streams and in-core meshes: STL, PLY, OBJ, glTF in and out.

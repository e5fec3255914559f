// The object: a bar of 1 x 1 x 4 m, hanging down from z = 0.
SetFactory("OpenCASCADE");
Box(1) = {-0.5, -0.5, -4, 1, 1, 4};
Mesh.MeshSizeMin = 0.292;
Mesh.MeshSizeMax = 0.292;
Mesh.Algorithm3D = 1; // Delaunay

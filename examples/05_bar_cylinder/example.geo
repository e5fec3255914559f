// The example's body: a cylinder as long as the bar, and as wide as its square, 0.6 m in radius.
SetFactory("OpenCASCADE");
Cylinder(1) = {0, 0, -4, 0, 0, 4, 0.6};
Mesh.MeshSizeMin = 0.127;
Mesh.MeshSizeMax = 0.127;
Mesh.Algorithm3D = 1; // Delaunay

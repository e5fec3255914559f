// The example's body: the same bar on another, coarser tessellation, ten times as large and elsewhere.
// gmsh -3 -format msh22 example.geo -o example_rest.msh
SetFactory("OpenCASCADE");
Box(1) = {100, 0, -50, 40, 10, 10};
Mesh.MeshSizeMin = 4;
Mesh.MeshSizeMax = 4;
Mesh.Algorithm3D = 1;

// The object: a bar of 4 x 1 x 1 m along x. gmsh -3 -format msh22 bar.geo -o bar.msh
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 4, 1, 1};
Mesh.MeshSizeMin = 0.292;
Mesh.MeshSizeMax = 0.292;
Mesh.Algorithm3D = 1;

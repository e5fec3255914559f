// The example's body: the same upright cross, 4.4 m wide and high, of beams of 0.6 x 0.6 m.
SetFactory("OpenCASCADE");
Box(1) = {-0.3, -0.3, -2.2, 0.6, 0.6, 4.4};
Box(2) = {-2.2, -0.3, -0.3, 4.4, 0.6, 0.6};
BooleanUnion{ Volume{1}; Delete; }{ Volume{2}; Delete; }
Mesh.MeshSizeMin = 0.111;
Mesh.MeshSizeMax = 0.111;
Mesh.Algorithm3D = 1; // Delaunay

// The example's body: the same bar, tessellated in another way.
SetFactory("OpenCASCADE");
Box(1) = {-0.5, -0.5, -4, 1, 1, 4};
Mesh.MeshSizeMin = 0.305;
Mesh.MeshSizeMax = 0.305;
Mesh.Algorithm = 5; // Delaunay; the object has another, and another size
Mesh.Algorithm3D = 1;

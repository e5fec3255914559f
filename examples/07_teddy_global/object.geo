// The object.
Include "teddy.geo";
Mesh.MeshSizeMin = 0.168;
Mesh.MeshSizeMax = 0.168;

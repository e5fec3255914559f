// The example's body: the same teddy on a fine tessellation of its own.
Include "teddy.geo";
Mesh.MeshSizeMin = 0.0496;
Mesh.MeshSizeMax = 0.0496;

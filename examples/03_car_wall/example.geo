// The example's body: another car, longer, with a bonnet that is less steep, an upright back and wider wheels.
SetFactory("OpenCASCADE");

// Side view of body and cabin, pulled out to both sides.
Point(1) = {-0.2, 0, 0.4};
Point(2) = {4.1, 0, 0.4};
Point(3) = {4.1, 0, 0.9};
Point(4) = {3.9, 0, 1.4};
Point(5) = {1.9, 0, 1.4};
Point(6) = {1.4, 0, 0.95};
Point(7) = {-0.1, 0, 0.85};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 5};
Line(5) = {5, 6}; Line(6) = {6, 7}; Line(7) = {7, 1};
Curve Loop(1) = {1 : 7};
Plane Surface(1) = {1};
Translate {0, -0.85, 0} { Surface{1}; }
Extrude {0, 1.7, 0} { Surface{1}; }

// Wheels, 0.45 m wide.
Cylinder(11) = {0.75, -0.85, 0.4, 0, 0.45, 0, 0.4};
Cylinder(12) = {3.25, -0.85, 0.4, 0, 0.45, 0, 0.4};
Cylinder(13) = {0.75, 0.4, 0.4, 0, 0.45, 0, 0.4};
Cylinder(14) = {3.25, 0.4, 0.4, 0, 0.45, 0, 0.4};
BooleanUnion{ Volume{1}; Delete; }{ Volume{11 : 14}; Delete; }

Mesh.MeshSizeMin = 0.225;
Mesh.MeshSizeMax = 0.225;
Mesh.Algorithm3D = 1; // Delaunay

// The object: a car of 4 x 1.6 x 1.4 m, nose at low x, wheels on z = 0.
SetFactory("OpenCASCADE");

// Side view of body and cabin, pulled out to both sides.
Point(1) = {0, 0, 0.4};
Point(2) = {4, 0, 0.4};
Point(3) = {4, 0, 0.85};
Point(4) = {3.6, 0, 0.9};
Point(5) = {3.0, 0, 1.4};
Point(6) = {1.8, 0, 1.4};
Point(7) = {1.2, 0, 0.9};
Point(8) = {0.1, 0, 0.75};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 5};
Line(5) = {5, 6}; Line(6) = {6, 7}; Line(7) = {7, 8}; Line(8) = {8, 1};
Curve Loop(1) = {1 : 8};
Plane Surface(1) = {1};
Translate {0, -0.8, 0} { Surface{1}; }
Extrude {0, 1.6, 0} { Surface{1}; }

// Wheels, 0.4 m wide.
Cylinder(11) = {0.8, -0.8, 0.4, 0, 0.4, 0, 0.4};
Cylinder(12) = {3.2, -0.8, 0.4, 0, 0.4, 0, 0.4};
Cylinder(13) = {0.8, 0.4, 0.4, 0, 0.4, 0, 0.4};
Cylinder(14) = {3.2, 0.4, 0.4, 0, 0.4, 0, 0.4};
BooleanUnion{ Volume{1}; Delete; }{ Volume{11 : 14}; Delete; }

Mesh.MeshSizeMin = 0.255;
Mesh.MeshSizeMax = 0.255;
Mesh.Algorithm3D = 1; // Delaunay

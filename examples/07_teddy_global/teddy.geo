// A teddy of 2.4 m that looks along -y; its left is +x. Ellipsoids in one piece, included by object.geo and example.geo.
SetFactory("OpenCASCADE");

// An ellipsoid at (x, y, z), of radii (a, b, c), its poles then turned forward by nod and sideways by tilt. The seam of the sphere
// starts at the back, so that it meets no other part.
Macro AddPart
  n = newv;
  Sphere(n) = {0, 0, 0, 1};
  Rotate { {0, 0, 1}, {0, 0, 0}, Pi / 2 } { Volume{n}; }
  Dilate { {0, 0, 0}, {a, b, c} } { Volume{n}; }
  Rotate { {1, 0, 0}, {0, 0, 0}, nod } { Volume{n}; }
  Rotate { {0, 1, 0}, {0, 0, 0}, tilt } { Volume{n}; }
  Translate { x, y, z } { Volume{n}; }
  parts[] += n;
Return

parts[] = {};
nod = 0; tilt = 0;
// Body, head and muzzle.
x = 0; y = 0;     z = 0.93; a = 0.55; b = 0.45; c = 0.62;
Call AddPart;
x = 0; y = -0.02; z = 1.80; a = 0.48; b = 0.42; c = 0.44;
Call AddPart;
x = 0; y = -0.38; z = 1.70; a = 0.21; b = 0.17; c = 0.22; nod = Pi / 2;
Call AddPart;
nod = 0;
// Ears, arms and legs.
For side In {-1 : 1 : 2}
  x = 0.38 * side; y = 0;     z = 2.15; a = 0.20; b = 0.13; c = 0.20; tilt = 0.7 * side;
  Call AddPart;
  x = 0.78 * side; y = -0.05; z = 1.05; a = 0.19; b = 0.19; c = 0.46; tilt = 1.95 * side;
  Call AddPart;
  x = 0.40 * side; y = -0.06; z = 0.36; a = 0.27; b = 0.28; c = 0.52; tilt = -0.32 * side;
  Call AddPart;
EndFor
BooleanUnion{ Volume{parts[0]}; Delete; }{ Volume{parts[{1 : #parts[] - 1}]}; Delete; }
Mesh.Algorithm3D = 1; // Delaunay

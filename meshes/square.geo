// Square cell of the paper's Figure 2: one fibre of fraction 0.4 in the middle of a 1 x 1 cell.
// gmsh -2 square.geo -o square.msh
SetFactory("Built-in");
p = 0.4;
h = 0.08;
r = Sqrt(p / Pi);

Point(1) = {0, 0, 0, h};
Point(2) = {1, 0, 0, h};
Point(3) = {1, 1, 0, h};
Point(4) = {0, 1, 0, h};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};

Point(5) = {0.5, 0.5, 0};
Point(6) = {0.5 + r, 0.5, 0, h};
Point(7) = {0.5, 0.5 + r, 0, h};
Point(8) = {0.5 - r, 0.5, 0, h};
Point(9) = {0.5, 0.5 - r, 0, h};
Circle(5) = {6, 5, 7};
Circle(6) = {7, 5, 8};
Circle(7) = {8, 5, 9};
Circle(8) = {9, 5, 6};

Curve Loop(1) = {1, 2, 3, 4};
Curve Loop(2) = {5, 6, 7, 8};
Plane Surface(1) = {1, 2};
Plane Surface(2) = {2};

Periodic Curve {2} = {4} Translate {1, 0, 0};
Periodic Curve {3} = {1} Translate {0, 1, 0};

Physical Surface("matrix") = {1};
Physical Surface("fibre") = {2};

// Two fibres of two materials in a 2 x 1 cell: an ellipse, debonded on its right side, and a circle.
// gmsh -2 two_fibres.geo -o two_fibres.msh
SetFactory("Built-in");
h = 0.08;

// The cell: any rectangle, its lower left corner where you like.
Point(1) = {0, 0, 0, h};
Point(2) = {2, 0, 0, h};
Point(3) = {2, 1, 0, h};
Point(4) = {0, 1, 0, h};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {4, 3};
Line(4) = {1, 4};

// The ellipse in quarters, each from a start by the centre and a point of the long axis to an end.
Point(10) = {0.6, 0.5, 0};
Point(11) = {1.0, 0.5, 0, h};
Point(12) = {0.6, 0.8, 0, h};
Point(13) = {0.2, 0.5, 0, h};
Point(14) = {0.6, 0.2, 0, h};
Ellipse(11) = {11, 10, 11, 12};
Ellipse(12) = {12, 10, 13, 13};
Ellipse(13) = {13, 10, 13, 14};
Ellipse(14) = {14, 10, 11, 11};

// The circle.
Point(20) = {1.5, 0.5, 0};
Point(21) = {1.8, 0.5, 0, h};
Point(22) = {1.5, 0.8, 0, h};
Point(23) = {1.2, 0.5, 0, h};
Point(24) = {1.5, 0.2, 0, h};
Circle(21) = {21, 20, 22};
Circle(22) = {22, 20, 23};
Circle(23) = {23, 20, 24};
Circle(24) = {24, 20, 21};

// Surfaces share their curves, so that fibre and matrix share their nodes.
Curve Loop(1) = {1, 2, -3, -4};
Curve Loop(2) = {11, 12, 13, 14};
Curve Loop(3) = {21, 22, 23, 24};
Plane Surface(1) = {1, 2, 3};
Plane Surface(2) = {2};
Plane Surface(3) = {3};

// Opposite sides have the same nodes: right like left, upper like lower.
Periodic Curve {2} = {4} Translate {2, 0, 0};
Periodic Curve {3} = {1} Translate {0, 1, 0};

// The phases, and what is debonded from the start.
Physical Surface("matrix") = {1};
Physical Surface("fibre") = {2};
Physical Surface("fibre:2") = {3};
Physical Curve("debonded") = {11, 14};

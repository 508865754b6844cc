// Hexagonal cell of the paper's Figure 2: 1 x sqrt(3), a fibre in the middle and one at the corners, fraction 0.4.
// gmsh -2 hexagonal.geo -o hexagonal.msh
SetFactory("Built-in");
p = 0.4;
h = 0.08;
b = Sqrt(3);
r = Sqrt(p * b / (2 * Pi));

// Corners, and where the corner fibre crosses the sides.
Point(1) = {0, 0, 0, h};
Point(2) = {1, 0, 0, h};
Point(3) = {1, b, 0, h};
Point(4) = {0, b, 0, h};
Point(11) = {r, 0, 0, h};
Point(12) = {1 - r, 0, 0, h};
Point(13) = {1, r, 0, h};
Point(14) = {1, b - r, 0, h};
Point(15) = {1 - r, b, 0, h};
Point(16) = {r, b, 0, h};
Point(17) = {0, b - r, 0, h};
Point(18) = {0, r, 0, h};

// Sides: bottom, right, top from left to right, left upwards.
Line(1) = {1, 11};
Line(2) = {11, 12};
Line(3) = {12, 2};
Line(4) = {2, 13};
Line(5) = {13, 14};
Line(6) = {14, 3};
Line(7) = {4, 16};
Line(8) = {16, 15};
Line(9) = {15, 3};
Line(10) = {1, 18};
Line(11) = {18, 17};
Line(12) = {17, 4};

// Quarters of the corner fibre, each counter-clockwise about its corner.
Circle(21) = {11, 1, 18};
Circle(22) = {13, 2, 12};
Circle(23) = {15, 3, 14};
Circle(24) = {17, 4, 16};

// The fibre in the middle.
Point(20) = {0.5, b / 2, 0};
Point(21) = {0.5 + r, b / 2, 0, h};
Point(22) = {0.5, b / 2 + r, 0, h};
Point(23) = {0.5 - r, b / 2, 0, h};
Point(24) = {0.5, b / 2 - r, 0, h};
Circle(31) = {21, 20, 22};
Circle(32) = {22, 20, 23};
Circle(33) = {23, 20, 24};
Circle(34) = {24, 20, 21};

Curve Loop(1) = {2, -22, 5, -23, -8, -24, -11, -21};
Curve Loop(2) = {31, 32, 33, 34};
Curve Loop(3) = {1, 21, -10};
Curve Loop(4) = {3, 4, 22};
Curve Loop(5) = {6, -9, 23};
Curve Loop(6) = {-7, -12, 24};
Plane Surface(1) = {1, 2};
Plane Surface(2) = {2};
Plane Surface(3) = {3};
Plane Surface(4) = {4};
Plane Surface(5) = {5};
Plane Surface(6) = {6};

Periodic Curve {4, 5, 6} = {10, 11, 12} Translate {1, 0, 0};
Periodic Curve {7, 8, 9} = {1, 2, 3} Translate {0, b, 0};

Physical Surface("matrix") = {1};
Physical Surface("fibre") = {2, 3, 4, 5, 6};

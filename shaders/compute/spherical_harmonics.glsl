// Real spherical harmonics with tiny-cuda-nn's order and signs.
// Defines: harmonic(), harmonicSlope().

float harmonic(uint i, vec3 d) {
  const float x = d.x, y = d.y, z = d.z;
  switch (i) {
    case 0: return 0.28209479177387814;
    case 1: return -0.48860251190291987 * y;
    case 2: return 0.48860251190291987 * z;
    case 3: return -0.48860251190291987 * x;
    case 4: return 1.0925484305920792 * x * y;
    case 5: return -1.0925484305920792 * y * z;
    case 6: return 0.94617469575755997 * z * z - 0.31539156525251999;
    case 7: return -1.0925484305920792 * x * z;
    case 8: return 0.54627421529603959 * (x * x - y * y);
    case 9: return 0.59004358992664352 * y * (y * y - 3 * x * x);
    case 10: return 2.8906114426405538 * x * y * z;
    case 11: return 0.45704579946446572 * y * (1 - 5 * z * z);
    case 12: return 0.37317633259011546 * z * (5 * z * z - 3);
    case 13: return 0.45704579946446572 * x * (1 - 5 * z * z);
    case 14: return 1.4453057213202769 * z * (x * x - y * y);
    default: return 0.59004358992664352 * x * (3 * y * y - x * x);
  }
}

// Returns the gradient of the polynomial as a function on R³.
vec3 harmonicSlope(uint i, vec3 d) {
  const float x = d.x, y = d.y, z = d.z;
  const float a = 0.48860251190291987, b = 1.0925484305920792, c = 0.94617469575755997, e = 0.54627421529603959;
  const float f = 0.59004358992664352, h = 2.8906114426405538, p = 0.45704579946446572, q = 0.37317633259011546;
  const float r = 1.4453057213202769;
  switch (i) {
    case 0: return vec3(0);
    case 1: return vec3(0, -a, 0);
    case 2: return vec3(0, 0, a);
    case 3: return vec3(-a, 0, 0);
    case 4: return vec3(b * y, b * x, 0);
    case 5: return vec3(0, -b * z, -b * y);
    case 6: return vec3(0, 0, 2 * c * z);
    case 7: return vec3(-b * z, 0, -b * x);
    case 8: return vec3(2 * e * x, -2 * e * y, 0);
    case 9: return vec3(-6 * f * x * y, 3 * f * (y * y - x * x), 0);
    case 10: return vec3(h * y * z, h * x * z, h * x * y);
    case 11: return vec3(0, p * (1 - 5 * z * z), -10 * p * y * z);
    case 12: return vec3(0, 0, q * (15 * z * z - 3));
    case 13: return vec3(p * (1 - 5 * z * z), 0, -10 * p * x * z);
    case 14: return vec3(2 * r * x * z, -2 * r * y * z, r * (x * x - y * y));
    default: return vec3(3 * f * (y * y - x * x), 6 * f * x * y, 0);
  }
}

// Sine and cosine with an error of one or two units in the last place for |x| < 10^4, from S. Moshier's Cephes library
// (sinf.c): Vulkan guarantees only an absolute error of 2^-11 for sin() and cos(), and only up to π.
// Defines: sineAndCosine(), sine(), cosine(), tangent().

vec2 sineAndCosine(float x) {
  precise const float quarters = floor(x * 0.63661977 + 0.5);
  // π/2 is split into three parts; the products of `quarters` and the first two are exact.
  precise float r = x - quarters * 1.5703125;
  r = r - quarters * 4.837512969970703e-4;
  r = r - quarters * 7.549789948768648e-8;
  const float square = r * r;
  const float s = r + r * square * ((-1.9515295891e-4 * square + 8.3321608736e-3) * square - 1.6666654611e-1);
  const float c = 1 - 0.5 * square +
                  square * square * ((2.443315711809948e-5 * square - 1.388731625493765e-3) * square + 4.166664568298827e-2);
  const int quarter = int(quarters) & 3;
  const vec2 turned = (quarter & 1) == 0 ? vec2(s, c) : vec2(c, -s);
  return (quarter & 2) == 0 ? turned : -turned;
}

float sine(float x) { return sineAndCosine(x).x; }
float cosine(float x) { return sineAndCosine(x).y; }
float tangent(float x) {
  const vec2 both = sineAndCosine(x);
  return both.x / both.y;
}

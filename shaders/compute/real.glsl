// The number type for the positions of samples: double if the device supports it (TESSERA_FLOAT64), otherwise float.
// GLSL has no exponential and logarithm of doubles; those defined here are accurate to a few units in the last place.
// Defines: real, realVec3, unpackReal(), expReal(), logReal(), kRoundingShare.
#ifdef TESSERA_FLOAT64
#define real double
#define realVec3 dvec3
const double kRoundingShare = 1e-9LF;  // a generous bound of the relative rounding error of a distance

double unpackReal(RealArguments bits) { return packDouble2x32(uvec2(bits.low, bits.high)); }

// Requires |x| < 700.
double expReal(double x) {
  const double k = floor(x * 1.4426950408889634LF + 0.5LF);
  const double r = (x - k * 0.6931471803691238LF) - k * 1.9082149292705877e-10LF;  // |r| < 0.35
  double sum = 1.0LF;
  for (int n = 13; n > 0; --n) sum = 1.0LF + r / n * sum;
  return sum * packDouble2x32(uvec2(0, uint(int(k) + 1023) << 20));
}

// One step of Halley's method for exp(y) = x: the error is the cube of that of a float's logarithm.
double logReal(double x) {
  const double y = log(float(x));
  const double e = expReal(y);
  return y + 2.0LF * (x - e) / (x + e);
}

#else
#define real float
#define realVec3 vec3
const float kRoundingShare = 1e-5;

float unpackReal(RealArguments bits) { return uintBitsToFloat(bits.low); }
float expReal(float x) { return exp(x); }
float logReal(float x) { return log(x); }
#endif

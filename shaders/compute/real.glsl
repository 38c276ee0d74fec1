// The arithmetic that decides where samples lie: double where the device has it (TESSERA_FLOAT64), else float. GLSL has
// no exponential and no logarithm of doubles: these are right to a few units in the last place.
// Defines: real, realVec3, realOf(), expOf(), logOf(), kRoundingShare.
#ifdef TESSERA_FLOAT64
#define real double
#define realVec3 dvec3
const double kRoundingShare = 1e-9LF;  // what may have been lost of a distance, generously

double realOf(RealArguments bits) { return packDouble2x32(uvec2(bits.low, bits.high)); }

// |x| < 700
double expOf(double x) {
  const double k = floor(x * 1.4426950408889634LF + 0.5LF);
  const double r = (x - k * 0.6931471803691238LF) - k * 1.9082149292705877e-10LF;  // |r| < 0.35
  double sum = 1.0LF;
  for (int n = 13; n > 0; --n) sum = 1.0LF + r / n * sum;
  return sum * packDouble2x32(uvec2(0, uint(int(k) + 1023) << 20));
}

// One step of Halley's method for exp(y) = x takes the error of a float's logarithm to its cube.
double logOf(double x) {
  const double y = log(float(x));
  const double e = expOf(y);
  return y + 2.0LF * (x - e) / (x + e);
}

#else
#define real float
#define realVec3 vec3
const float kRoundingShare = 1e-5;

float realOf(RealArguments bits) { return uintBitsToFloat(bits.low); }
float expOf(float x) { return exp(x); }
float logOf(float x) { return log(x); }
#endif

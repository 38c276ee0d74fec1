// CHECK(a == b) guards against programming errors: where the condition is false it prints both values and aborts, in
// every build type.
#pragma once

#include <sstream>
#include <string>

#if defined(__clang__)
#pragma clang diagnostic ignored "-Woverloaded-shift-op-parentheses"  // for Splitter::operator<<
#endif

namespace tessera::check_internal {

[[noreturn]] void fail(const char* file, int line, const char* expression, const std::string& values);

template <class T>
concept Streamable = requires(std::ostream& out, const T& value) {
  out << value;
};

template <class T>
void print(std::ostream& out, const T& value) {
  if constexpr (Streamable<T>) {
    out << value;
  } else {
    out << "(unprintable)";
  }
}

struct Result {
  bool ok;
  std::string values;
};

template <class L>
struct Left {
  const L& left;

  template <class R>
  Result result(bool ok, const R& right) const {
    if (ok) return {true, {}};
    std::ostringstream out;
    print(out, left);
    out << " against ";
    print(out, right);
    return {false, out.str()};
  }
  template <class R>
  Result operator==(const R& r) const {
    return result(left == r, r);
  }
  template <class R>
  Result operator!=(const R& r) const {
    return result(left != r, r);
  }
  template <class R>
  Result operator<(const R& r) const {
    return result(left < r, r);
  }
  template <class R>
  Result operator<=(const R& r) const {
    return result(left <= r, r);
  }
  template <class R>
  Result operator>(const R& r) const {
    return result(left > r, r);
  }
  template <class R>
  Result operator>=(const R& r) const {
    return result(left >= r, r);
  }
  operator Result() const { return {static_cast<bool>(left), "false"}; }
};

struct Splitter {
  template <class L>
  Left<L> operator<<(const L& left) const {
    return {left};
  }
};

}  // namespace tessera::check_internal

#define CHECK(expression)                                                                                      \
  do {                                                                                                         \
    const ::tessera::check_internal::Result checkResult = ::tessera::check_internal::Splitter{} << expression; \
    if (!checkResult.ok) ::tessera::check_internal::fail(__FILE__, __LINE__, #expression, checkResult.values); \
  } while (false)

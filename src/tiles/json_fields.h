// Fields of JSON from outside: nothing where one is missing, of another kind, or no finite number.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>

namespace tessera::json_fields {

using nlohmann::json;

inline const json* fieldOf(const json& object, const char* key) {
  if (!object.is_object()) return nullptr;
  const auto found = object.find(key);
  return found == object.end() ? nullptr : &*found;
}

inline const json* arrayOf(const json& object, const char* key) {
  const json* field = fieldOf(object, key);
  return field && field->is_array() ? field : nullptr;
}

inline const std::string* stringOf(const json& object, const char* key) {
  const json* field = fieldOf(object, key);
  return field && field->is_string() ? &field->get_ref<const std::string&>() : nullptr;
}

inline bool isString(const json& object, const char* key, std::string_view expected) {
  const std::string* text = stringOf(object, key);
  return text && *text == expected;
}

// Not get<T>() of any kind: nlohmann throws on a wrong one and wraps a negative number.
inline std::optional<uint64_t> unsignedFrom(const json& value, uint64_t most) {
  if (!value.is_number_unsigned() || value.get<uint64_t>() > most) return std::nullopt;
  return value.get<uint64_t>();
}

inline std::optional<uint32_t> unsignedOf(const json& object, const char* key, uint32_t most = UINT32_MAX) {
  const json* field = fieldOf(object, key);
  const auto value = field ? unsignedFrom(*field, most) : std::nullopt;
  return value ? std::optional(static_cast<uint32_t>(*value)) : std::nullopt;
}

inline std::optional<double> numberFrom(const json& value) {
  if (!value.is_number() || !std::isfinite(value.get<double>())) return std::nullopt;
  return value.get<double>();
}

inline std::optional<double> numberOf(const json& object, const char* key) {
  const json* field = fieldOf(object, key);
  return field ? numberFrom(*field) : std::nullopt;
}

inline std::optional<bool> flagOf(const json& object, const char* key) {
  const json* field = fieldOf(object, key);
  return field && field->is_boolean() ? std::optional(field->get<bool>()) : std::nullopt;
}

template <size_t N>
std::optional<std::array<double, N>> numbersFrom(const json& value) {
  if (!value.is_array() || value.size() != N) return std::nullopt;
  std::array<double, N> numbers;
  for (size_t i = 0; i < N; ++i) {
    const auto number = numberFrom(value[i]);
    if (!number) return std::nullopt;
    numbers[i] = *number;
  }
  return numbers;
}

template <size_t N>
std::optional<std::array<double, N>> numbersOf(const json& object, const char* key) {
  const json* field = fieldOf(object, key);
  return field ? numbersFrom<N>(*field) : std::nullopt;
}

}  // namespace tessera::json_fields

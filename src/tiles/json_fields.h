// Typed access to the fields of untrusted JSON. Functions return nothing (or null) if a field is missing, has another
// type, or is not a finite number.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>

namespace tessera::json_fields {

using nlohmann::json;

inline const json* getField(const json& object, const char* key) {
  if (!object.is_object()) return nullptr;
  const auto it = object.find(key);
  return it == object.end() ? nullptr : &*it;
}

inline const json* getArray(const json& object, const char* key) {
  const json* field = getField(object, key);
  return field && field->is_array() ? field : nullptr;
}

inline const std::string* getString(const json& object, const char* key) {
  const json* field = getField(object, key);
  return field && field->is_string() ? &field->get_ref<const std::string&>() : nullptr;
}

inline bool isString(const json& object, const char* key, std::string_view expected) {
  const std::string* text = getString(object, key);
  return text && *text == expected;
}

// nlohmann's get<T>() would throw on another type and wrap negative numbers.
inline std::optional<uint64_t> unsignedFrom(const json& value, uint64_t maximum) {
  if (!value.is_number_unsigned() || value.get<uint64_t>() > maximum) return std::nullopt;
  return value.get<uint64_t>();
}

inline std::optional<uint32_t> getUnsigned(const json& object, const char* key, uint32_t maximum = UINT32_MAX) {
  const json* field = getField(object, key);
  const auto value = field ? unsignedFrom(*field, maximum) : std::nullopt;
  return value ? std::optional(static_cast<uint32_t>(*value)) : std::nullopt;
}

inline std::optional<double> numberFrom(const json& value) {
  if (!value.is_number() || !std::isfinite(value.get<double>())) return std::nullopt;
  return value.get<double>();
}

inline std::optional<double> getNumber(const json& object, const char* key) {
  const json* field = getField(object, key);
  return field ? numberFrom(*field) : std::nullopt;
}

inline std::optional<bool> getBoolean(const json& object, const char* key) {
  const json* field = getField(object, key);
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
std::optional<std::array<double, N>> getNumbers(const json& object, const char* key) {
  const json* field = getField(object, key);
  return field ? numbersFrom<N>(*field) : std::nullopt;
}

}  // namespace tessera::json_fields

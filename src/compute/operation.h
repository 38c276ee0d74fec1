// What makes a struct of arguments an operation: a name, declared beside the struct. Who runs an operation includes its
// header and no other operation's.
#pragma once

#include <cstdint>
#include <string_view>

namespace tessera {

// An operation as devices tell it apart. Two are the same where their names are.
class OperationId {
 public:
  // `name` outlives it.
  constexpr explicit OperationId(std::string_view name) : name_(name) {
    for (const char letter : name) hash_ = (hash_ ^ static_cast<unsigned char>(letter)) * 0x100000001b3;
  }
  constexpr std::string_view name() const { return name_; }
  // FNV-1a of the name (Fowler, Noll, Vo), a constant that a device's `switch` takes: two operations of one hash do not
  // compile (operations.h).
  constexpr uint64_t hash() const { return hash_; }
  friend constexpr bool operator==(const OperationId& a, const OperationId& b) { return a.name_ == b.name_; }
  friend constexpr auto operator<=>(const OperationId& a, const OperationId& b) { return a.name_ <=> b.name_; }

 private:
  std::string_view name_;
  uint64_t hash_ = 0xcbf29ce484222325;
};

// Specialised by TESSERA_OPERATION for structs of arguments alone.
template <class Arguments>
struct OperationTraits;

// Stands below the struct, in its namespace.
#define TESSERA_OPERATION(Arguments)              \
  template <>                                     \
  struct OperationTraits<Arguments> {             \
    static constexpr OperationId kId{#Arguments}; \
  }

template <class Arguments>
concept Operation = requires {
  OperationTraits<Arguments>::kId;
};

template <Operation Arguments>
inline constexpr const OperationId& kOperation = OperationTraits<Arguments>::kId;

}  // namespace tessera

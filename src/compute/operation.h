// Turns a struct of arguments into an operation by declaring a name beside the struct. Code that runs an operation
// includes the header of that operation and of no other.
#pragma once

#include <cstdint>
#include <string_view>

namespace tessera {

// Identifies an operation. Two ids are equal if their names are.
class OperationId {
 public:
  // `name` must outlive the id.
  constexpr explicit OperationId(std::string_view name) : name_(name) {
    for (const char letter : name) hash_ = (hash_ ^ static_cast<unsigned char>(letter)) * 0x100000001b3;
  }
  constexpr std::string_view name() const { return name_; }
  // The FNV-1a hash of the name (Fowler, Noll, Vo), a constant for use in a `switch`: two operations with the same hash
  // do not compile (operations.h).
  constexpr uint64_t hash() const { return hash_; }
  friend constexpr bool operator==(const OperationId& a, const OperationId& b) { return a.name_ == b.name_; }
  friend constexpr auto operator<=>(const OperationId& a, const OperationId& b) { return a.name_ <=> b.name_; }

 private:
  std::string_view name_;
  uint64_t hash_ = 0xcbf29ce484222325;
};

// Specialised by TESSERA_OPERATION, only for structs of arguments.
template <class Arguments>
struct OperationTraits;

// The macro must be placed below the struct, in its namespace.
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

// Errors caused by the program's input: files, flags, the network. They are thrown anywhere and caught once, in main.
#pragma once

#include <stdexcept>
#include <string>

namespace tessera {

// An error is printed as `tessera: error: what: where: why; remedy`, in one line, with control characters escaped as
// \x1b.
//   what    the object that failed, usually a path
//   where   the location inside it (line, byte, key); may be empty
//   why     what is wrong there
//   remedy  what the user can do about it
class Error : public std::runtime_error {
 public:
  Error(std::string what, std::string where, std::string why, std::string remedy);

  const std::string& subject() const { return subject_; }
  const std::string& place() const { return place_; }
  const std::string& reason() const { return reason_; }
  const std::string& remedy() const { return remedy_; }

 private:
  std::string subject_, place_, reason_, remedy_;
};

}  // namespace tessera

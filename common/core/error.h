#pragma once

#include <stdexcept>
#include <string>

namespace exmat {

/// Exit statuses of both programs.
enum class ExitStatus { kDone = 0, kFailure = 1, kBadInput = 2 };

/// A fault of an input, in the parts that its author needs to mend it. Empty parts are left out of the message.
struct Complaint {
  std::string file;      ///< path as the user gave it
  std::string place;     ///< line, JSON pointer, dataset path or element within the file
  std::string expected;  ///< content of a sound file there
  std::string found;     ///< content of this one
  std::string advice;    ///< remedy, a sentence without the full stop
};

/// One message of the form "FILE: PLACE: expected ..., found ...; ADVICE".
std::string to_string(const Complaint& complaint);

/// Bad usage or bad input: becomes one message and exit status 2.
class InputError : public std::runtime_error {
 public:
  explicit InputError(Complaint complaint);
  const Complaint& complaint() const { return complaint_; }

 private:
  Complaint complaint_;
};

/// A failure while working on sound input (disk full, no convergence): exit status 1.
class WorkError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace exmat

#include "common/core/error.h"

namespace exmat {

std::string to_string(const Complaint& complaint) {
  std::string text;
  const auto append = [&text](const std::string& separator, const std::string& part) {
    if (part.empty()) return;
    if (!text.empty()) text += separator;
    text += part;
  };
  append("", complaint.file);
  append(": ", complaint.place);
  if (!complaint.expected.empty()) append(": ", "expected " + complaint.expected);
  if (!complaint.found.empty()) append(complaint.expected.empty() ? ": " : ", ", "found " + complaint.found);
  append("; ", complaint.advice);
  return text;
}

InputError::InputError(Complaint complaint)
    : std::runtime_error(to_string(complaint)), complaint_(std::move(complaint)) {}

}  // namespace exmat

#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "runtime/api/failures.h"

namespace exmat::runtime {

// Two archives that go through the members of a state in the same order: visit(archive, state) describes a state once.

/// Writes the numbers of a state from `to` on, or only counts them where that is null and beyond `room` numbers.
class StateWriter {
 public:
  explicit StateWriter(double* to = nullptr, std::size_t room = std::numeric_limits<std::size_t>::max())
      : to_(to), room_(to != nullptr ? room : 0) {}

  std::size_t count() const noexcept { return count_; }
  static constexpr bool checks() noexcept { return false; }

  void number(double number) noexcept {
    if (fits(1)) to_[count_] = number;
    ++count_;
  }
  /// A force or an energy.
  void load(double load) noexcept { number(load); }
  template <typename Dense>
  void load(const Dense& load) noexcept {
    array(load);
  }
  template <typename Dense>
  void array(const Dense& array) noexcept {
    const auto size = static_cast<std::size_t>(array.size());
    if (fits(size)) std::copy_n(array.data(), array.size(), to_ + count_);
    count_ += size;
  }
  template <typename Dense>
  void array(const Dense& own, Eigen::Index /*rows*/, Eigen::Index /*columns*/) noexcept {
    array(own);
  }
  /// Room for as many numbers; null where they are only counted.
  double* room(std::size_t count) noexcept {
    double* const room = fits(count) ? to_ + count_ : nullptr;
    count_ += count;
    return room;
  }

  void same(const char* /*name*/, double expected, const char* /*unit*/, const char* /*advice*/) noexcept {
    number(expected);
  }
  bool flag(const char* /*name*/, bool value) noexcept {
    number(value ? 1 : 0);
    return value;
  }
  void not_negative(const char* /*name*/, double value) noexcept { number(value); }
  template <typename Whole>
  std::size_t whole(const char* /*name*/, Whole value, double /*end*/) noexcept {
    number(static_cast<double>(value));
    return static_cast<std::size_t>(value);
  }
  void skip(std::size_t /*count*/) const noexcept {}
  template <typename List>
  std::size_t size(const char* name, const List& list) noexcept {
    return whole(name, list.size(), 0);
  }

 private:
  bool fits(std::size_t more) const noexcept { return count_ + more <= room_; }

  double* to_;
  std::size_t room_, count_ = 0;
};

/// Takes the numbers of a state, from the first on, or only checks them: throws InvalidArgument where they are not
/// those of such a state. To be used twice, since what takes them stops nowhere that the check has passed.
class StateReader {
 public:
  enum class Use { kCheck, kTake };
  /// A check refuses numbers that are not finite or beyond `farthest`, of forces and energies not finite alone; without
  /// it any number is taken, as it was saved.
  StateReader(std::span<const double> numbers, Use use, std::optional<double> farthest = {})
      : numbers_(numbers), takes_(use == Use::kTake), farthest_(farthest) {}

  std::size_t left() const noexcept { return numbers_.size(); }
  bool checks() const noexcept { return !takes_; }

  std::span<const double> take(std::size_t count) { return take_within(farthest_.value_or(kMost), count); }
  /// The numbers hold forces: `loads` of them, from `first` on.
  std::span<const double> take(std::size_t count, std::size_t first, std::size_t loads) {
    const auto taken = take_within(kMost, count);
    require_within(farthest_.value_or(kMost), taken.first(first));
    require_within(farthest_.value_or(kMost), taken.subspan(first + loads));
    return taken;
  }
  void skip(std::size_t count) { take(count); }
  void number(double& number) { set(take(1).front(), number); }
  void load(double& load) { set(take_within(kMost, 1).front(), load); }
  template <typename Dense>
  void load(Dense& load) {
    copy(take_within(kMost, static_cast<std::size_t>(load.size())), load);
  }
  template <typename Dense>
  void array(Dense& array) {
    copy(take(static_cast<std::size_t>(array.size())), array);
  }
  /// Into an array that gets this size.
  template <typename Dense>
  void array(Dense& own, Eigen::Index rows, Eigen::Index columns) {
    if (!takes_) return skip(static_cast<std::size_t>(rows * columns));
    own.resize(rows, columns);
    array(own);
  }

  void same(const char* name, double expected, const char* unit, const char* advice) {
    if (const double found = take(1).front(); found != expected)
      throw InvalidArgument(
          fmt::format("numbers: {} {:g}{}: expected {:g}{}{}", name, found, unit, expected, unit, advice));
  }
  bool flag(const char* name, bool& value) {
    const double found = take(1).front();
    if (found != 0 && found != 1)
      throw InvalidArgument(fmt::format("numbers: {} = {:g}: expected 0 or 1", name, found));
    set(found == 1, value);
    return found == 1;
  }
  void not_negative(const char* name, double& value) {
    const double found = take_within(kMost, 1).front();
    if (!(found >= 0)) throw InvalidArgument(fmt::format("numbers: expected {} >= 0", name));
    set(found, value);
  }
  /// A whole number below `end`.
  template <typename Whole>
  std::size_t whole(const char* name, Whole& value, double end) {
    const double found = take(1).front();
    if (!(found >= 0 && found < end && found == std::floor(found)))
      throw InvalidArgument(fmt::format("numbers: {} = {:g}: expected a whole number below {:g}", name, found, end));
    set(static_cast<Whole>(found), value);
    return static_cast<std::size_t>(found);
  }
  /// The size of a list, each entry of which takes at least one number.
  template <typename Entry>
  std::size_t size(const char* name, std::vector<Entry>& list) {
    std::size_t unused = 0;
    const std::size_t size = whole(name, unused, static_cast<double>(left()));
    if (takes_) list.resize(size);
    return size;
  }

 private:
  static constexpr double kMost = std::numeric_limits<double>::max();

  std::span<const double> take_within(double most, std::size_t count) {
    if (count > numbers_.size()) throw InvalidArgument("numbers: they end early: are they of another model or world?");
    const auto taken = numbers_.first(count);
    require_within(most, taken);
    numbers_ = numbers_.subspan(count);
    return taken;
  }
  void require_within(double most, std::span<const double> numbers) const {
    if (!checks() || !farthest_) return;
    for (const double number : numbers)
      if (!(std::abs(number) <= most))
        throw InvalidArgument(fmt::format("numbers: {}: expected finite ones of at most {}", number, most));
  }
  template <typename Dense>
  void copy(std::span<const double> from, Dense& to) const {
    if (takes_) std::copy_n(from.data(), from.size(), to.data());
  }
  template <typename Value>
  void set(Value found, Value& value) const noexcept {
    if (takes_) value = found;
  }

  std::span<const double> numbers_;
  bool takes_;
  std::optional<double> farthest_;
};

}  // namespace exmat::runtime

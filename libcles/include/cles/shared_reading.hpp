// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <any>
#include <concepts>
#include <type_traits>

namespace cles::detail {

/// What one body has been found to be, for all feeds that are handed it one after the other. Of values it keeps the
/// first that is plain data, which is copied for less than it is read, and shares nothing with its copies.
class shared_reading {
  public:
    template <class T>
    static constexpr bool keeps = std::is_trivially_copyable_v<T>&& std::copyable<T>;

    /// Null: nobody has read it as a T.
    template <class T>
    [[nodiscard]] const T* get() const noexcept {
        return std::any_cast<T>(&value_);
    }
    template <class T>
    void put(const T& value) {
        if (!value_.has_value()) {
            value_ = value;
        }
    }
    [[nodiscard]] bool is_json() const noexcept { return is_json_; }
    void found_json() noexcept { is_json_ = true; }
    void clear() noexcept {
        value_.reset();
        is_json_ = false;
    }

  private:
    std::any value_;
    bool is_json_ = false;
};

} // namespace cles::detail

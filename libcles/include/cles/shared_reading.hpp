// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <any>
#include <concepts>
#include <type_traits>

namespace cles::detail {

/// The result of reading one body, shared by all feeds that receive it in turn. Keeps the first value that is trivially
/// copyable, because copying it is cheaper than reading it again, and copies share no state.
class shared_reading {
  public:
    template <class T>
    static constexpr bool keeps = std::is_trivially_copyable_v<T>&& std::copyable<T>;

    /// Null if no T is kept.
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

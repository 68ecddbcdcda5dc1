// SPDX-License-Identifier: BSL-1.0
#include "prime_counter.hpp"

#include <algorithm>

namespace primes {

prime_counter::prime_counter(std::uint64_t from, std::uint64_t below)
    : from_(std::max<std::uint64_t>(from, 2)), below_(below), at_(from_) {
    for (std::uint64_t d = 2; d * d < below_; ++d) {
        if (is_prime(d)) {
            divisors_.push_back(d);
        }
    }
}

bool prime_counter::step() {
    if (at_ >= below_) {
        return false;
    }
    const auto size = static_cast<std::size_t>(std::min<std::uint64_t>(stretch, below_ - at_));
    composite_.assign(size, false);
    for (const auto d : divisors_) {
        // Smaller multiples have a smaller divisor.
        const auto first = std::max(d * d, (at_ + d - 1) / d * d);
        for (auto multiple = first; multiple < at_ + size; multiple += d) {
            composite_[static_cast<std::size_t>(multiple - at_)] = true;
        }
    }
    for (std::size_t i = 0; i < size; ++i) {
        if (!composite_[i]) {
            ++count_;
            largest_ = at_ + i;
        }
    }
    at_ += size;
    return at_ < below_;
}

double prime_counter::part_done() const noexcept {
    return at_ >= below_ ? 1 : static_cast<double>(at_ - from_) / static_cast<double>(below_ - from_);
}

bool is_prime(std::uint64_t number) noexcept {
    if (number < 4) {
        return number >= 2;
    }
    if (number % 2 == 0) {
        return false;
    }
    for (std::uint64_t d = 3; d <= number / d; d += 2) {
        if (number % d == 0) {
            return false;
        }
    }
    return true;
}

} // namespace primes

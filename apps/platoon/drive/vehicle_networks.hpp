// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <vector>

namespace platoon {

/// A network namespace for each vehicle, with a device `radio_device` that is connected to nothing but a descriptor:
/// what the vehicle sends can be read there, and what is written there arrives at it.
class vehicle_networks {
  public:
    /// Without the right to create them, this process enters a user namespace first, for good. \pre it has one thread
    /// \throws cles::error `no_target` if this system does not permit it
    explicit vehicle_networks(std::size_t vehicles);
    vehicle_networks(const vehicle_networks&) = delete;
    vehicle_networks& operator=(const vehicle_networks&) = delete;
    ~vehicle_networks();

    [[nodiscard]] int network_of(std::size_t vehicle) const { return all_[vehicle].network; }
    /// Of each vehicle, in their order.
    [[nodiscard]] std::vector<int> devices() const;

  private:
    struct one {
        int network = -1, device = -1;
    };

    void close() noexcept;

    std::vector<one> all_;
};

inline constexpr const char* radio_device = "radio";
/// The last number of a vehicle's address, 10.83.0.x.
inline constexpr unsigned host_number(std::size_t vehicle) { return static_cast<unsigned>(vehicle) + 1; }

} // namespace platoon

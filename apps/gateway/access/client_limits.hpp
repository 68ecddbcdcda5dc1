// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>

namespace gateway {

/// Limits the connections, in all and of one address. A new one takes the place of one that waits for its client, which
/// sends no request or reads no response, of the address that has the most, so that addresses that only hold
/// connections open shut out no others. Sans-I/O.
class client_limits {
  public:
    /// \param of_address 0: not limited, as behind a proxy, where all have one address
    client_limits(std::size_t most, std::size_t of_address) noexcept : most_(most), of_address_(of_address) {}

    struct verdict {
        std::uint64_t number = 0;               ///< of the new connection; 0: it is refused
        std::optional<std::uint64_t> evicted{}; ///< that has to be closed for it
    };
    [[nodiscard]] verdict admit(const std::string& address);
    void leave(std::uint64_t number);
    /// Whether it is being served. At first it is not.
    void set_busy(std::uint64_t number, bool is_busy);
    [[nodiscard]] std::size_t size() const noexcept { return clients_.size(); }

  private:
    /// The connections of one address.
    struct holder {
        std::size_t count = 0;
        std::set<std::uint64_t> idle{}; ///< in the order in which they came
    };
    /// Whose oldest connection that is idle gives way to another one; null if there is none.
    [[nodiscard]] const holder* largest() const;

    std::size_t most_;
    std::size_t of_address_;
    std::uint64_t last_ = 0;
    std::map<std::uint64_t, std::string> clients_; // their addresses
    std::map<std::string, holder> holders_;        // by address
};

/// What counts as one client: an IPv4 address, or an IPv6 network of 64 bits.
std::string client_address(const std::string& address);

} // namespace gateway

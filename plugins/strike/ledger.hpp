// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "order.hpp"

#include <boost/describe/class.hpp>

#include <string>
#include <vector>

namespace strike {

/// What an aircraft has done, and for whom.
struct ledger_entry {
    double utc = 0;             ///< s since 1970
    std::string event{};        ///< `released`
    std::string requester{};    ///< the member that has ordered it; empty without security
    std::string confirmed_by{}; ///< the second member; empty where the aircraft requires none
    std::string forwarded_by{}; ///< the member that has forwarded the order; mostly empty
    order what{};
    double aim_lat = 0; ///< of a release
    double aim_lon = 0;
    double impact_utc = 0;
};
BOOST_DESCRIBE_STRUCT(ledger_entry, (),
                      (utc, event, requester, confirmed_by, forwarded_by, what, aim_lat, aim_lon, impact_utc))

/// A file to which entries are only ever added, each as a line of JSON. An entry is on the disk before `add` returns,
/// so that what it records can follow.
class ledger {
  public:
    /// Opens the file, which is created if it is missing. A last line that was cut off, because the host lost its power
    /// while it was written, is removed: nothing has followed it.
    /// \throws std::runtime_error that says what is wrong, without the path
    explicit ledger(const std::string& path);
    ~ledger();
    ledger(const ledger&) = delete;
    ledger& operator=(const ledger&) = delete;

    /// What the file contained when it was opened.
    [[nodiscard]] const std::vector<ledger_entry>& before() const noexcept { return before_; }
    /// \throws std::runtime_error as above
    void add(const ledger_entry& entry);

  private:
    void read();

    int file_ = -1;
    std::vector<ledger_entry> before_;
};

} // namespace strike

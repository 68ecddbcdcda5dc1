// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/registrar.hpp>

#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>

namespace sysinfo {

struct settings {
    std::optional<std::uint32_t>
        interval_ms; ///< between updates to those that are bound, 10 to 86400000; 1000 unless set
    std::optional<std::uint32_t> processes; ///< how many are listed, at most 1000; 10 unless set

    /// \throws cles::setting_error
    void check() const;
};
BOOST_DESCRIBE_STRUCT(settings, (), (interval_ms, processes))

/// Information about the machine, by PULL and BIND, for all applications (paper, section 3.5): `utc`, `load`, `memory`,
/// `disk`, `network` and `processes`, from the kernel's own files. The structures of those names document the members.
/// Also `systemTime`, by PULL and DELEGATE (section 3.3).
void register_tasks(cles::registrar& to, const settings& wanted);

} // namespace sysinfo

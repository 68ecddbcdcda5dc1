// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/handler_shape.hpp>
#include <cles/plugin_abi.h>
#include <cles/plugin_config.hpp>
#include <cles/plugin_registrar.hpp>
#include <cles/registrar.hpp>
#include <cles/setting_error.hpp>

#include <cstddef>
#include <exception>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>

/// A plugin for `clesd` in C++ (paper, section 3.6): a function that registers tasks, and one line.
///
///     void register_tasks(cles::registrar& to) {
///         to.on_pull("answer", [] { return 42; });
///     }
///     CLES_PLUGIN("answers", "1.0", register_tasks)
///
/// The same function works for an application's service and a test. It may take settings as a second argument, of any
/// type that `<cles/convert.hpp>` reads; they are read from `config` of the plugin in the daemon's configuration. If
/// the settings are a described struct, unknown names are refused, and members of type `std::optional` may be left out.
/// The struct may have a `void check() const` that throws a `cles::setting_error` if a value is not valid; `clesd
/// --check` calls only that, not the function.
///
///     void register_tasks(cles::registrar& to, const settings& wanted);
///
/// If the function throws, the plugin is not loaded, and the message is written to the daemon's log.
///
/// Threads. The function runs once, on the daemon's main thread. Handlers run on threads of a pool, several at a time,
/// so they must protect shared data; those that are `inline_ok` run on the I/O thread and block it. Responders may be
/// used on any thread.
///
/// Lifetime. What handlers hold is destroyed when the daemon stops and the last job that uses it has ended, so threads
/// and devices should be owned by the handlers that need them. The library itself stays loaded until the process ends.
///
/// Link `cles::plugin`, or use `cles_add_plugin` of the CMake package, which also hides all symbols except the entry
/// point. Only the C structures of <cles/plugin_abi.h> are exchanged, so compiler and Boost may differ from the
/// daemon's.
///
/// \param name         of the plugin, as text
/// \param version      of the plugin, as text
/// \param registration the function's name; not overloaded
#define CLES_PLUGIN(name, version, registration)                                                                       \
    extern "C" CLES_PLUGIN_EXPORT const cles_plugin* cles_plugin_v1() {                                                \
        return ::cles::detail::plugin_entry<&(registration)>::describe(name, version);                                 \
    }

namespace cles::detail {

/// The functions that the host calls, for a plugin whose tasks `Register` registers.
template <auto Register>
class plugin_entry {
  public:
    static const cles_plugin* describe(std::string_view name, std::string_view version) noexcept {
        static const cles_plugin description{.size = sizeof(cles_plugin),
                                             .abi_major = CLES_PLUGIN_ABI_MAJOR,
                                             .abi_minor = 0, // works without later additions
                                             .reserved = 0,
                                             .name = abi_text(name),
                                             .version = abi_text(version),
                                             .start = &start,
                                             .stop = &stop,
                                             .check = &check};
        return &description;
    }

  private:
    // Never destroyed, because jobs that do not end may use them while the process exits.
    static plugin_registrar::task_list& tasks() {
        static auto* const list = new plugin_registrar::task_list;
        return *list;
    }

    // Reads the settings, if any, and passes them to `use`.
    template <class F>
    static void with_settings(cles_text config, F&& use) {
        using arguments = typename call_signature<decltype(Register)>::arguments;
        if constexpr (std::tuple_size_v<arguments> == 1) {
            expect_no_config(view_of(config));
            use();
        } else {
            using settings = std::remove_cvref_t<std::tuple_element_t<1, arguments>>;
            use(detail::plugin_config<settings>(view_of(config)));
        }
    }

    // True if it does not throw; otherwise reports the reason to the host.
    template <class F>
    static bool succeeds(const cles_host& host, F&& what) noexcept {
        try {
            std::forward<F>(what)();
            return true;
        } catch (const setting_error& e) {
            constexpr auto end = offsetof(cles_host, refuse_setting) + sizeof(cles_host::refuse_setting);
            if (host.size >= end) {
                host.refuse_setting(&host, abi_text(e.key()), abi_text(e.message()));
            } else {
                host.refuse(&host, abi_text(e.message()));
            }
        } catch (const error& e) {
            host.refuse(&host, abi_text(e.message()));
        } catch (const std::exception& e) {
            host.refuse(&host, abi_text(e.what()));
        } catch (...) {
            host.refuse(&host, abi_text("it threw something that is not an exception"));
        }
        return false;
    }

    static int32_t check(const cles_host* host, cles_text config) noexcept {
        return succeeds(*host, [&] { with_settings(config, [](const auto&...) {}); }) ? 0 : 1;
    }

    static int32_t start(const cles_host* host, cles_text config) noexcept {
        const bool started = succeeds(*host, [&] {
            plugin_registrar to{*host, tasks()};
            with_settings(config,
                          [&](auto&&... settings) { Register(to, std::forward<decltype(settings)>(settings)...); });
        });
        if (started) {
            return 0;
        }
        stop();
        return 1;
    }

    static void stop() noexcept {
        for (const auto& task : tasks()) {
            task->stop();
        }
    }
};

} // namespace cles::detail

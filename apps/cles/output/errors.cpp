// SPDX-License-Identifier: BSL-1.0
#include "output/errors.hpp"

#include <cles/error.hpp>

#include "output/terminal.hpp"

#include <boost/system/system_error.hpp>

#include <csignal>
#include <string>

namespace tool {
namespace {

int exit_code_of(const cles::error& failure) {
    if (failure.code().category() != cles::error_category()) {
        return exit_code::local_failure; // a system error: connecting or listening failed
    }
    switch (static_cast<cles::errc>(failure.code().value())) {
    case cles::errc::no_target:
    case cles::errc::no_task: return exit_code::not_found;
    case cles::errc::deadline: return exit_code::deadline;
    case cles::errc::busy: return exit_code::busy;
    case cles::errc::unavailable:
    case cles::errc::bad_request:
    case cles::errc::denied:
    case cles::errc::too_large:
    case cles::errc::cancelled:
    case cles::errc::failed:
    case cles::errc::conversion: return exit_code::remote_error;
    case cles::errc::invalid_url:
    case cles::errc::unknown_scheme:
    case cles::errc::insecure_listen:
    case cles::errc::invalid_name:
    case cles::errc::invalid_option: return exit_code::usage;
    case cles::errc::would_deadlock:
    case cles::errc::already_registered:
    case cles::errc::stopped:
    case cles::errc::closed: return exit_code::local_failure;
    }
    return exit_code::remote_error;
}

// For a system error first the operation that failed, then the reason, which is not repeated.
std::string message_of(const cles::error& e) {
    const auto reason = e.code().message();
    if (e.code().category() == cles::error_category() || e.message().empty()) {
        return e.what();
    }
    return e.message().find(reason) != std::string::npos ? e.message() : e.message() + ": " + reason;
}

} // namespace

void print_error(std::string_view text) { write_stderr(red(stream::err, "cles:") + " " + printable(text) + "\n"); }

void note(std::string_view text) { write_stderr("cles: " + printable(text) + "\n"); }

int report_failure(const std::exception_ptr& thrown) {
    try {
        std::rethrow_exception(thrown);
    } catch (const output_closed&) {
        return exit_code::success;
    } catch (const output_interrupted&) {
        return exit_code::signalled + SIGINT;
    } catch (const usage_error& e) {
        print_error(e.what());
        return exit_code::usage;
    } catch (const cles::error& e) {
        print_error(message_of(e));
        return exit_code_of(e);
    } catch (const boost::system::system_error& e) {
        print_error(e.code().message()); // what() may contain the path of a header
        return exit_code::local_failure;
    } catch (const std::exception& e) {
        print_error(e.what());
        return exit_code::local_failure;
    }
}

} // namespace tool

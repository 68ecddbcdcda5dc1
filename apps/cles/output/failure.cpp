// SPDX-License-Identifier: BSL-1.0
#include "output/failure.hpp"

#include <cles/error.hpp>

#include "output/diagnostics.hpp"
#include "output/exit_code.hpp"

#include <boost/system/system_error.hpp>

#include <csignal>
#include <string>

namespace tool {
namespace {

// Of a system error first what could not be done, then why; not the other way round, and not twice.
std::string words_of(const cles::error& e) {
    const auto why = e.code().message();
    if (e.code().category() == cles::error_category() || e.message().empty()) {
        return e.what();
    }
    return e.message().find(why) != std::string::npos ? e.message() : e.message() + ": " + why;
}

} // namespace

int report_failure(const std::exception_ptr& thrown) {
    try {
        std::rethrow_exception(thrown);
    } catch (const output_closed&) {
        return exit_code::success;
    } catch (const output_interrupted&) {
        return exit_code::signalled + SIGINT;
    } catch (const usage_error& e) {
        complain(e.what());
        return exit_code::usage;
    } catch (const cles::error& e) {
        complain(words_of(e));
        return exit_code::of(e);
    } catch (const boost::system::system_error& e) {
        complain(e.code().message()); // what() may hold the path of a header
        return exit_code::local_failure;
    } catch (const std::exception& e) {
        complain(e.what());
        return exit_code::local_failure;
    }
}

} // namespace tool

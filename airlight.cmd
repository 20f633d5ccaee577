@echo off
rem SPDX-License-Identifier: BSD-3-Clause
rem
rem The twin of the launcher `airlight` for Windows: runs `airlight` from `.venv` beside this file, which the first start
rem makes from the versions of requirements.lock (`airlight test`: and requirements-test.lock). AIRLIGHT_PYTHON names another Python than the newest that is found.
rem Exit status 3: something is missing. What is missing of LLVM is named by `airlight doctor`, with the line to type.
rem Nobody has tried this file on Windows yet. Its line ends must stay CR LF: cmd.exe loses labels otherwise.

setlocal
set "root=%~dp0"
set "venv=%root%.venv"
set "python=%venv%\Scripts\python.exe"

rem The environment was made from these two files; copies in it, written last, say from which versions.
if not exist "%python%" goto make
fc /b "%root%requirements.lock" "%venv%\requirements.lock" >nul 2>&1 || goto install
fc /b "%root%pyproject.toml" "%venv%\pyproject.toml" >nul 2>&1 || goto install
goto run

:make
set "base="
if not defined AIRLIGHT_PYTHON goto search
call :try "%AIRLIGHT_PYTHON%"
if defined base goto venv
echo airlight: AIRLIGHT_PYTHON is "%AIRLIGHT_PYTHON%", which is no Python 3.11 or newer>&2
exit /b 3

:search
for %%p in ("py -3.13" "py -3.12" "py -3.11" "python") do if not defined base call :try %%~p
if defined base goto venv
echo airlight: Python 3.11 or newer is needed: winget install -e --id Python.Python.3.13>&2
exit /b 3

:venv
echo airlight: making .venv, once; about a minute>&2
%base% -m venv "%venv%"
if not errorlevel 1 goto install
echo airlight: the environment "%venv%" could not be made, see above>&2
exit /b 3

:install
"%python%" -m pip --disable-pip-version-check --no-input -qq install -r "%root%requirements.lock"
if errorlevel 1 goto failed
"%python%" -m pip --disable-pip-version-check --no-input -qq install --no-deps --no-build-isolation -e "%root%."
if errorlevel 1 goto failed
copy /y "%root%requirements.lock" "%venv%\requirements.lock" >nul
copy /y "%root%pyproject.toml" "%venv%\pyproject.toml" >nul
for /f "skip=1 delims=" %%l in ('""%python%" -m reports.machine.doctor"') do (
    echo airlight: system libraries are missing: %%l>&2
)

:run
if not "%~1"=="test" goto start
fc /b "%root%requirements-test.lock" "%venv%\requirements-test.lock" >nul 2>&1 && goto start
"%python%" -m pip --disable-pip-version-check --no-input -qq install -r "%root%requirements-test.lock"
if errorlevel 1 goto failed
copy /y "%root%requirements-test.lock" "%venv%\requirements-test.lock" >nul

:start
"%python%" "%root%airlight.py" %*
exit /b %errorlevel%

:failed
echo airlight: the packages could not be installed, see above; start again>&2
exit /b 3

:try
%* -c "import sys; sys.exit(sys.version_info < (3, 11))" >nul 2>&1 && set base=%*
exit /b 0

"""What notebooks of the site print: of an error the last line, of a figure a sharp picture."""

c = get_config()  # noqa: F821
c.InteractiveShell.xmode = "Minimal"
c.InteractiveShell.colors = "nocolor"
c.InlineBackend.figure_formats = {"png"}
c.IPKernelApp.log_level = 40

from typer.models import CommandInfo


def drawing():
    pass


DRAWING = CommandInfo(callback=drawing)

import { UnstyledButton } from "@mantine/core";
import { IconHelpCircle } from "@tabler/icons-react";
import { type ReactNode, useId, useState } from "react";
import { createPortal } from "react-dom";
import classes from "./Help.module.css";

interface Props {
  /** The question that the tap answers: "What is the interval?" */
  question: string;
  children: ReactNode;
}

/** An explanation on demand; a finger's width to hit, a letter's width to look at. */
export function Help({ question, children }: Props) {
  const id = useId();
  const [open, setOpen] = useState(false);
  return (
    <>
      <UnstyledButton
        className={classes["ask"]}
        aria-label={question}
        aria-haspopup="dialog"
        title={question}
        popoverTarget={id}
      >
        <IconHelpCircle size={17} aria-hidden />
      </UnstyledButton>
      {createPortal(
        <div
          id={id}
          popover="auto"
          role="dialog"
          aria-label={question}
          tabIndex={-1}
          className={classes["answer"]}
          onToggle={(event) => {
            setOpen(event.newState === "open");
            if (event.newState === "open") event.currentTarget.focus();
          }}
        >
          {open && children}
        </div>,
        document.body,
      )}
    </>
  );
}

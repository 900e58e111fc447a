import { UnstyledButton } from "@mantine/core";
import { IconHelpCircle } from "@tabler/icons-react";
import { useId, useState } from "react";
import { createPortal } from "react-dom";
import { EXPLANATIONS, type Topic } from "./explanations";
import classes from "./HelpTip.module.css";

/** Help button with an explanation; its touch target is larger than its icon. */
export function HelpTip({ topic }: { topic: Topic }) {
  const [question, ...answer] = EXPLANATIONS[topic];
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
          {open && answer.map((paragraph) => <p key={paragraph}>{paragraph}</p>)}
        </div>,
        document.body,
      )}
    </>
  );
}

/** Text of the contract: paragraphs, with names in backticks. */
export function Prose({ text }: { text: string }) {
    return (
        <>
            {text.split(/\n\s*\n/).map((paragraph, index) => (
                <p key={index}>
                    {paragraph
                        .split(/`([^`]*)`/)
                        .map((part, place) => (place % 2 === 1 ? <code key={place}>{part}</code> : part))}
                </p>
            ))}
        </>
    );
}
